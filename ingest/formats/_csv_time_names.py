"""What the name of a column says of time: whether it holds a time, a date or a part of a second, and in which unit."""

from __future__ import annotations

import re

from ingest.formats._csv_dialect import Dialect

_SPELT = {  # [ns] -> units of time, in lower case
    1.0: "ns nsec nsecs nanosec nanoseconds",
    1e3: "us µs μs usec usecs microsec microsecond microseconds mikrosekunde mikrosekunden",
    1e6: "ms msec millisecond milliseconds millisekunde millisekunden millisecondes",
    1e9: "s sec secs sek second seconds sekunde sekunden secondi secondes segundos 秒 초 сек",
    60e9: "min mins minute minutes minuten minuti minutos 分 분 мин",
    3600e9: "h hr hrs hour hours std stunden ore heures horas",
    86_400e9: "day days tage giorni jours",
}
UNITS_NS = {unit: in_ns for in_ns, units in _SPELT.items() for unit in units.split()}
_TIMES = (
    "time times timestamp tstamp timestring timestampepoch epoch unixtime datetime elapsed elapsedtime ts ticks "
    "filetime zeit zeitstempel datumzeit uhrzeit tempo dataora dataeora temps heure horodatage dateheure tiempo hora "
    "fechahora время 時間 時刻 日時 时间 日期时间 시간 일시"
)
TIME_NAMES = frozenset(_TIMES.split())
X_NAMES = frozenset(("x", "xaxis", "xachse", "xvalue", "xvalues", "xwert", "xwerte"))
DATE_WORDS = frozenset(("date", "datetime", "datum", "data", "fecha", "дата", "日付", "日期", "날짜"))
ZONE_WORDS = frozenset(("tz", "timezone", "zeitzone"))
LIKE_TIME = re.compile(
    r"(?i)time|zeit|tiempo|tijd|elapsed|dauer\b|duration|sekunden|seconds|minuten|minutes|hours|stunden"
    r"|время|時間|时间|시간"
    r"|\b(?:secs?|sek)(?:\b|_)|(?-i:\bt_?rel\b)|^second$|\bms$"
)
PART_OF_TIME = re.compile(
    r"(?i)step|schritt|cycle|zyklus|\blap|delta|delay|dead|response|constant|konstant|rise|fall|settl|age?ing|alterung|dose|above"
)
LIKE_UNITS = {"sekunden": "s", "seconds": "s", "minuten": "min", "minutes": "min", "stunden": "h", "hours": "h"}
ZONE_IN_NAME = re.compile(
    r"(?:^|[\s_([])(?P<zone>(?:UTC|GMT)(?: ?[+-]\d{1,2}(?::?\d{2})?)?|[+-]\d{2}:\d{2}|CES?T|MES?Z"
    r"|[A-Z]\w+/[A-Z]\w+)[)\]]?$"
)
_PARTS = (
    "year jahr anno année annee año ano yyyy yy",
    "month monat mese mois mes mm",
    "day tag giorno jour día dia dd",
    "hour hours stunde ora heure hora hh h",
    "minute minutes minuti minuto min",
    "second seconds sekunde secondi seconde segundo sec s ss",
)
PARTS_OF_STAMP = [frozenset(names.split()) for names in _PARTS]  # of columns that hold one part each
COUNTERS = {"millis": ("time", "ms"), "micros": ("time", "us")}  # as small controllers call their clocks
DIGITS = {1e6: 3, 1e3: 6, 1.0: 9}  # of the part of a second that is counted in a unit of so many ns
FRACTIONS = frozenset(("fractional seconds", "fractional second", "fraction of second"))  # 0.25: Keithley's scanners
CATMAN_TIME = re.compile(r"(?:time|zeit) +\d+ - ", re.IGNORECASE)  # "Zeit  1 - Standardmessrate"


def unit_of_time(text: str | None) -> str | None:
    """The key of `UNITS_NS` that a unit such as `Min`, `MS` and `Sek.` is; None for another, or none."""
    unit = (text or "").casefold().strip(" .")
    return unit if unit in UNITS_NS else None


def digits_of(name: str) -> int:
    """Of the part of the second that a column with this name holds: 3 of `ms` and `Time(ms)`, 6 of `us`, 9 of `ns`; 0
    of others."""
    base, unit = base_and_unit(name)
    said = unit if (base in TIME_NAMES or base.endswith("stamp")) and unit else name
    return DIGITS.get(UNITS_NS.get(said.casefold(), 0.0), 0)


def is_part_of_second(name: str) -> bool:
    """Whether a column with this name holds the part of a second, counted or as a fraction."""
    return digits_of(name) > 0 or name.casefold() in FRACTIONS


def is_time_name(name: str) -> bool:
    """Whether the name of a column says that it holds the time: `t` does, `T` alone is a temperature."""
    base = base_and_unit(name)[0]
    return base in TIME_NAMES or (base == "t" and name.startswith("t")) or CATMAN_TIME.match(name) is not None


def is_like_time(name: str) -> bool:
    """Whether the name of a column may be that of a time among others: `Messzeit`, `Test time`, `Seconds`; not that of
    a step in it, of a delay, or of hours that something has aged."""
    return bool(LIKE_TIME.search(name)) and not PART_OF_TIME.search(name)


def unit_in_like(name: str) -> str | None:
    """The unit that the name of such a column says: "s" of `Seconds`, "h" of `Betriebsstunden` and `Run time (h)`."""
    last = (words(name) or [""])[-1]
    return unit_of_time(last) or next((unit for ends, unit in LIKE_UNITS.items() if last.endswith(ends)), None)


def is_x(name: str, dialect: Dialect, said: str | None = None) -> bool:
    """Whether a column is the X of others, as oscilloscopes and FAMOS call their times: one with a unit of time. `said`
    is what the header calls it."""
    base, unit = base_and_unit(said or name)
    last = base in X_NAMES or words(re.sub(r"\[.*", "", said or name))[-1:] == ["x"]
    return last and unit_of_time(unit or dialect.units.get(name)) is not None


def is_date_name(name: str) -> bool:
    """Whether the name of a column says that it holds a date."""
    return bool(DATE_WORDS.intersection(words(name)))


def zone_in_name(name: str) -> str | None:
    """The zone that the name of a column of stamps ends in: "UTC+1" of `Time (UTC+1)`, "Europe/Berlin", "CET"; None
    where it ends in none."""
    found = ZONE_IN_NAME.search(name)
    return found["zone"].replace(" ", "") if found else None


def is_zone_name(name: str) -> bool:
    """Whether the name of a column says that it holds the zone of its stamps."""
    said = words(name)
    return bool(ZONE_WORDS.intersection(said)) or {"utc", "offset"} <= {*said}


def base_and_unit(name: str) -> tuple[str, str | None]:
    """The name of a column and the unit in it: ("time", "s") of `Time [s]`, `time_s` and `Time in s`; `time_utc` is
    called ("time", None)."""
    said = [word for word in words(name) if word not in ("in", "utc", "ole2")]
    if "".join(said) in COUNTERS:
        return COUNTERS["".join(said)]
    unit = said.pop() if len(said) > 1 and said[-1] in UNITS_NS else None
    return "".join(said), unit


def words(name: str) -> list[str]:
    """The words of a column's name, in lower case."""
    return re.findall(r"[^\W_]+", name.casefold())
