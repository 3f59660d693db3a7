"""The time of tables: which column holds it, what its cells mean, and what is asked where they may mean two things."""

from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from zoneinfo import ZoneInfo

import numpy as np
import pytest

from ingest.errors import UnreadableLogError
from ingest.formats import TimeSpec, utc_ns
from made.tables import DECEMBER_NS, MARCH_NS, S_NS, read, table


@pytest.mark.parametrize(
    ("header", "cells", "wanted", "absolute"),
    [
        ("time", ["0", "0.5"], [0, S_NS // 2], False),
        ("Time [ms]", ["0", "500"], [0, S_NS // 2], False),
        ("time_us", ["0", "500000"], [0, S_NS // 2], False),
        ("Zeit in min", ["0", "0.5"], [0, 30 * S_NS], False),
        ("timestamp", ["1709280000", "1709280000.25"], [MARCH_NS, MARCH_NS + S_NS // 4], True),
        ("timestamp", ["1709280000000", "1709280000250"], [MARCH_NS, MARCH_NS + S_NS // 4], True),
        ("when", ["2024-03-01 08:00:00", "2024-03-01 08:00:00.25"], [MARCH_NS, MARCH_NS + S_NS // 4], True),
        ("when", ["2024/03/01 08:00:00:250", "2024/3/1 08:00"], [MARCH_NS + S_NS // 4, MARCH_NS], True),
        ("when", ["2024-03-01T08:00:00Z", "2024-03-01T09:00:00+01:00"], [MARCH_NS, MARCH_NS], True),
        ("DateTime", ["01.03.2024 08:00:00,25", "01.03.2024 08:00"], [MARCH_NS + S_NS // 4, MARCH_NS], True),
    ],
)
def test_a_time_column_is_recognised(
    tmp_path: Path, header: str, cells: list[str], wanted: list[int], absolute: bool
) -> None:
    path = table(tmp_path, f"n;{header}\n" + "".join(f"1;{cell}\n" for cell in cells))
    log, t_ns, columns = read(path)
    assert (t_ns, log.absolute, list(columns)) == (wanted, absolute, ["n"])
    assert log.settings["time_column"] == header


@pytest.mark.parametrize(
    ("text", "second_ns", "says"),
    [
        ("t_s,time_utc,T\n0,2024-03-01T08:00:00,1\n1,2024-03-01T08:00:01,2\n", S_NS, "ISO 8601 in UTC"),
        ("t_s;time_utc;T\n0;01.03.2024 08:00:00,0;1\n1;01.03.2024 08:00:01,0;2\n", S_NS, "day.month.year in UTC"),
        (
            "t_s,Zeitstempel,T\n0.0,01.03.2024 09:00:00,1\n0.5,01.03.2024 09:00:00,2\n",
            S_NS // 2,
            "s from the start, dated by Zeitstempel",
        ),
        (
            "Datum;Uhrzeit;t_s;T\n01.03.2024;09:00:00;0;1\n01.03.2024;09:00:01;1;2\n",
            S_NS,
            "day.month.year in Europe/Berlin",
        ),
    ],
)
def test_a_date_beside_a_column_that_counts_is_not_lost(tmp_path: Path, text: str, second_ns: int, says: str) -> None:
    log, t_ns, _ = read(table(tmp_path, text), TimeSpec(zone="Europe/Berlin"))
    assert log.absolute and log.settings["time"] == says
    assert t_ns == [MARCH_NS, MARCH_NS + second_ns]


def test_a_date_that_does_not_go_on_with_the_rows_dates_nothing(tmp_path: Path) -> None:
    log, _, _ = read(table(tmp_path, "t_s,time,T\n0,2024-03-01T08:00:00,1\n9,2024-03-01T08:00:00,2\n"))
    assert not log.absolute and log.settings["time"] == "s from the start"


def test_a_clock_that_is_started_anew_in_the_middle_is_a_time(tmp_path: Path) -> None:
    rows = "".join(f"{k},20\n" for k in range(60))
    log, t_ns, _ = read(table(tmp_path, f"time_s,T\n{rows}time_s,T\n{rows}"))
    assert (len(t_ns), log.settings["backward_steps"], list(log.rejected)) == (120, 1, [])


def test_a_column_t_that_does_not_rise_is_a_temperature(tmp_path: Path) -> None:
    path = table(tmp_path, "t,n\n20,1\n19.5,1\n19.0,1\n20,1\n")
    with pytest.raises(
        UnreadableLogError, match=r"no column is recognised as its time\. Under \[time\] of the bench file say"
    ):
        read(path)


def test_a_table_without_time_is_refused_with_both_ways_out(tmp_path: Path) -> None:
    path = table(tmp_path, "uhr;T\n1;20\n2;21\n", "id_0.csv")
    with pytest.raises(UnreadableLogError) as refused:
        read(path)
    assert str(refused.value) == (
        "id_0.csv: no column is recognised as its time. "
        "Under [time] of the bench file say rate_hz = 1.0 (rows at a fixed "
        'rate), or column = "..." with format or unit.'
    )


@pytest.mark.parametrize("cells", ["1.74194E+12 1.74194E+12", "1.741939E+09 1.741939E+09 1.741940E+09"])
def test_times_that_were_rounded_when_they_were_saved_are_refused(tmp_path: Path, cells: str) -> None:
    path = table(tmp_path, "timestamp,T\n" + "".join(f"{cell},20\n" for cell in cells.split()))
    with pytest.raises(
        UnreadableLogError, match=r'"timestamp" holds "1\.7419\d+E\+\d+" in several rows: its times were'
    ):
        read(path)
    assert read(path, TimeSpec(rate_hz=1.0))[1][:2] == [0, S_NS]


def test_a_time_of_day_with_dots_is_not_offered_as_a_day(tmp_path: Path) -> None:
    with pytest.raises(UnreadableLogError, match=r'"Uhrzeit" holds "08\.00\.00"') as refusal:
        read(table(tmp_path, "Uhrzeit;T\n08.00.00;20,5\n08.00.01;20,6\n"))
    assert "(its days)" not in str(refusal.value)


def test_a_date_without_a_clock_is_shown_in_the_refusal(tmp_path: Path) -> None:
    path = table(tmp_path, "Time,T\n2024-03-01,20\n2024-03-02,21\n")
    with pytest.raises(UnreadableLogError, match=r'\("Time" holds "2024-03-01", which is no whole stamp\)'):
        read(path)


@pytest.mark.parametrize(
    ("cells", "seconds"),
    [
        ("23:59:58 23:59:59,5 00:00:01", [86_398, 86_399.5, 86_401]),
        ("00:00:00.0 23:59:59.0 24:00:00.0 100:06:40.0", [0, 86_399, 86_400, 360_400]),
        ("23:59:59 00:00:00 23:59:59 00:00:00", [86_399, 86_400, 172_799, 172_800]),
    ],
    ids=["over midnight", "elapsed", "over two midnights"],
)
def test_times_of_day_count_from_their_midnight_and_pass_the_next(
    tmp_path: Path, cells: str, seconds: list[float]
) -> None:
    path = table(tmp_path, "Uhrzeit;T\n" + "".join(f"{cell};1\n" for cell in cells.split()))
    log, t_ns, _ = read(path)
    assert (t_ns, log.absolute, len(log.rejected)) == ([round(s * S_NS) for s in seconds], False, 0)
    assert read(path, TimeSpec(start_ns=DECEMBER_NS))[1][0] == t_ns[0] + DECEMBER_NS


def test_a_time_of_day_that_is_none_is_rejected(tmp_path: Path) -> None:
    log, t_ns, _ = read(
        table(tmp_path, "Time,T\n11:59:59 AM,1\n12:61:00 PM,1\n13:00:00 PM,1\n12:00:01 PM,1\n12:00:02 PM,1\n")
    )
    assert (t_ns, len(log.rejected)) == ([s * S_NS for s in (43_199, 43_201, 43_202)], 2)


@pytest.mark.parametrize(
    ("name", "cells", "seconds"),
    [
        ("Time", "14:02 14:03 14:04", [50_520, 50_580, 50_640]),
        ("Uhrzeit", "23:59 00:00 00:01", [86_340, 86_400, 86_460]),
        ("Time [hh:mm]", "00:00 00:05 00:10", [0, 300, 600]),
        ("Time [mm:ss]", "05:00 05:01 05:02", [300, 301, 302]),
        ("Time", "12:59AM 1:00AM 1:01AM", [3540, 3600, 3660]),
        ("Time", "00:00 00:01 24:00", [0, 1, 1440]),
    ],
)
def test_hours_and_minutes_alone_are_told_from_minutes_and_seconds(
    tmp_path: Path, name: str, cells: str, seconds: list[int]
) -> None:
    log, t_ns, _ = read(table(tmp_path, f"{name};T\n" + "".join(f"{cell};1\n" for cell in cells.split())))
    assert (t_ns, log.absolute, len(log.rejected)) == ([s * S_NS for s in seconds], False, 0)


@pytest.mark.parametrize(
    ("head", "day", "clocks", "says", "seconds"),
    [
        (
            "date,time",
            "20240301",
            "140058 140059 140100",
            "year month day hour minute second",
            [50_458, 50_459, 50_460],
        ),
        (
            "date,time",
            "20240301",
            "080058 080059 080100",
            "year month day hour minute second",
            [28_858, 28_859, 28_860],
        ),
        ("Datum,Zeit", "01032024", "80059.5 80100.0", "day month year hour minute second", [28_859.5, 28_860]),
        ("Date,Time", "20240301", "1359 1400", "year month day hour minute", [50_340, 50_400]),
        ("x,time", "1", "140058 140059 140100", "time of day", [50_458, 50_459, 50_460]),
        ("x,Zeit", "1", "080058 080059 080100", "time of day", [28_858, 28_859, 28_860]),
    ],
)
def test_times_of_day_may_be_digits(
    tmp_path: Path, head: str, day: str, clocks: str, says: str, seconds: list[float]
) -> None:
    log, t_ns, _ = read(table(tmp_path, f"{head},T\n" + "".join(f"{day},{cell},20\n" for cell in clocks.split())))
    midnight_s = MARCH_NS // S_NS // 86_400 * 86_400 if log.absolute else 0
    assert log.settings["time"].startswith(f"{says} in digits")
    assert (t_ns, list(log.rejected)) == ([round((midnight_s + at_s) * S_NS) for at_s in seconds], [])


def test_seconds_are_no_digits_of_a_time_of_day(tmp_path: Path) -> None:
    for counts in (range(12_340, 12_440), range(60), range(100_000, 100_040), range(140_000, 141_000, 50)):
        log, t_ns, _ = read(table(tmp_path, "time,T\n" + "".join(f"{count},20\n" for count in counts)))
        assert (t_ns, log.settings["time"]) == ([count * S_NS for count in counts], "s from the start")


@pytest.mark.parametrize(
    ("head", "row"),
    [
        ("date,time,tz", "2024-03-01,09:00:0{k},CET"),
        ("tz,Timestamp", "+01:00,2024-03-01 09:00:0{k}"),
        ("Stamp,UTC Offset,ms", "01.03.2024 09:00:0{k},UTC+1,0"),
        ("Time (UTC),tz", "2024-03-01 08:00:0{k},CET"),
        ("Time,tz", "2024-03-01T08:00:0{k}Z,CET"),
    ],
)
def test_a_zone_in_a_column_of_its_own_belongs_to_the_stamp(tmp_path: Path, head: str, row: str) -> None:
    path = table(tmp_path, f"{head},T\n" + "".join(f"{row.format(k=k)},20\n" for k in range(3)))
    for spec in (TimeSpec(), TimeSpec(zone="America/New_York")):
        log, t_ns, columns = read(path, spec)
        if spec.zone == "UTC" or "Time (UTC)" not in head:
            assert (t_ns, log.absolute) == ([MARCH_NS + k * S_NS for k in range(3)], True)
    assert ("tz" in columns) == (head in ("Time (UTC),tz", "Time,tz"))


def test_a_zone_may_be_said_by_its_name(tmp_path: Path) -> None:
    rows = "".join(f"2024-07-01 09:00:0{k},Europe/Berlin,20\n" for k in range(3))
    log, t_ns, _ = read(table(tmp_path, "Time,timezone,T\n" + rows), TimeSpec(zone="America/New_York"))
    assert t_ns == [utc_ns(datetime(2024, 7, 1, 7, tzinfo=UTC)) + k * S_NS for k in range(3)]
    assert log.settings["time"].endswith("in Europe/Berlin")


@pytest.mark.parametrize(("name", "cell"), [("tz", "PST"), ("utc_offset", "1"), ("Zeitzone", "Sommerzeit")])
def test_a_zone_that_is_not_understood_is_asked_for(tmp_path: Path, name: str, cell: str) -> None:
    path = table(tmp_path, f"Time,{name},T\n" + "".join(f"2024-07-01 09:00:0{k},{cell},20\n" for k in range(3)))
    with pytest.raises(UnreadableLogError, match=f'column "{name}" says a zone otherwise than'):
        read(path)
    _, t_ns, _ = read(path, TimeSpec(zone="America/Los_Angeles"))
    assert t_ns[0] == utc_ns(datetime(2024, 7, 1, 16, tzinfo=UTC))


@pytest.mark.parametrize("cells", ["23:59:59 1.00:00:00.5", "23:59:59,1 day 0:00:00.5", "0d 23:59:59,1d 00:00:00.5"])
def test_times_since_a_start_go_on_after_a_day(tmp_path: Path, cells: str) -> None:
    said = cells.split("," if "," in cells else " ")
    _, t_ns, _ = read(table(tmp_path, "Elapsed;T\n" + "".join(f"{cell};20\n" for cell in said)))
    assert t_ns == [86_399 * S_NS, 86_400 * S_NS + S_NS // 2]


@pytest.mark.parametrize(
    ("head", "rows", "wanted"),
    [
        ("time_s,ms", "0,0 0,500 1,0 1,250", [0, 500_000_000, S_NS, 1_250_000_000]),
        (
            "timestamp,usec",
            "1709280000,0 1709280000,500000 1709280001,1",
            [MARCH_NS, MARCH_NS + S_NS // 2, MARCH_NS + S_NS + 1000],
        ),
        ("time,nsec", "0,0 0,500000000 1,0", [0, S_NS // 2, S_NS]),
        ("time_s,time_ms", "0,0 0,500 1,1000 1,1500", [0, 0, S_NS, S_NS]),
        ("time,ms", "0.0,0 0.5,500 1.0,0", [0, S_NS // 2, S_NS]),
    ],
)
def test_parts_of_a_second_in_a_column_of_their_own_belong_to_whole_seconds(
    tmp_path: Path, head: str, rows: str, wanted: list[int]
) -> None:
    _, t_ns, _ = read(table(tmp_path, f"{head},T\n" + "".join(f"{row},20\n" for row in rows.split())))
    assert t_ns == wanted


def test_days_as_matlab_counts_them_are_dates(tmp_path: Path) -> None:
    days = [739_312 + (8 * 3600 + k) / 86_400 for k in range(60)]  # datenum(2024, 3, 1)
    for zone, hours in (("UTC", 0), ("Europe/Berlin", 1)):
        path = table(tmp_path, "time,T\n" + "".join(f"{day:.9f},20\n" for day in days))
        log, t_ns, _ = read(path, TimeSpec(zone=zone))
        assert log.absolute
        np.testing.assert_allclose(
            np.array(t_ns) - MARCH_NS, [(k - 3600 * hours) * S_NS for k in range(60)], atol=60_000
        )


@pytest.mark.parametrize("clock", ["140000.25", "080000", "0800"])
def test_a_short_date_in_digits_is_asked_for_in_words_that_work(tmp_path: Path, clock: str) -> None:
    path = table(tmp_path, f"UTC Date,UTC Time,T\n140325,{clock},20\n140325,{clock},21\n")
    with pytest.raises(UnreadableLogError, match=r"may begin with the day, the month or the year") as refusal:
        read(path)
    form = str(refusal.value).split('format = "')[1].split('"')[0]
    (first, _), log = (found := read(path, TimeSpec(format=form)))[1], found[0]
    assert log.absolute and first % (86_400 * S_NS) == (50_400_250_000_000 if "." in clock else 28_800 * S_NS)


@pytest.mark.parametrize(
    ("name", "unit_s"),
    [
        *[("Seconds", 1), ("Sekunden", 1), ("Messzeit", 1), ("Test time", 1), ("Scan Time (s)", 1), ("t_rel", 1)],
        *[("ms", 1e-3), ("Laufzeit [min]", 60), ("Minuten", 60), ("Betriebsstunden", 3600), ("Run time (h)", 3600)],
    ],
)
def test_a_name_like_that_of_a_time_is_one_where_its_numbers_go_on(tmp_path: Path, name: str, unit_s: float) -> None:
    path = table(tmp_path, f"T;Step time;{name};n\n20;1;10;5\n21;2;10,5;5\n22;3;12;5\n")
    log, t_ns, columns = read(path)
    assert t_ns == [round(count * unit_s * S_NS) for count in (10, 10.5, 12)]
    assert (log.settings["time_column"], list(columns)) == (name, ["T", "Step time", "n"])


@pytest.mark.parametrize("cells", ["10 10 11", "10 11 10"])
def test_one_that_does_not_go_on_in_each_row_is_none(tmp_path: Path, cells: str) -> None:
    with pytest.raises(UnreadableLogError, match="no column is recognised as its time"):
        read(table(tmp_path, "T;Run time (h)\n" + "".join(f"20;{cell}\n" for cell in cells.split())))


@pytest.mark.parametrize(
    ("names", "at"),
    [
        ("Time (UTC+1),T", "2025-12-24 09:00:00"),
        ("Local time (GMT +01:00),T", "2025-12-24 09:00:00"),
        ("Zeit [MEZ],T", "24.12.2025 09:00:00"),
        ("Timestamp (Europe/Rome),T", "2025-12-24T09:00:00"),
        ("Date (UTC-5),Time (UTC-5),T", "24.12.2025,03:00:00"),
        ("Time (GMT),T", "2025-12-24 08:00:00"),
        ("Time (UTC+1),T", "2025-12-24T08:00:00Z"),  # the stamp itself goes before
    ],
)
def test_a_zone_in_the_name_of_a_column_is_that_of_its_stamps(tmp_path: Path, names: str, at: str) -> None:
    path = table(tmp_path, f"{names}\n{at},20\n{at},21\n{',' * at.count(',')},22\n")
    log, t_ns, _ = read(path, TimeSpec(zone="Asia/Tokyo"))
    assert (t_ns, log.absolute) == ([DECEMBER_NS, DECEMBER_NS], True)
    assert [one.why for one in log.rejected] == ["no time"]


@pytest.mark.parametrize(
    "stamp",
    [
        *("2025-12-24-08.00.00.000000", "2025-12-24 08-00-00", "2025_12_24_08_00_00", "2025-12-24_08:00:00"),
        *("24.12.2025-08:00:00", "24.12.2025_08:00:00,000", "2025/12/24-08:00:00", "2025-12-24T08-00-00.000"),
    ],
)
def test_other_signs_between_date_and_time_are_known(tmp_path: Path, stamp: str) -> None:
    log, t_ns, _ = read(table(tmp_path, f"Time\tT\n{stamp}\t20\n"))
    assert (t_ns, log.absolute) == ([DECEMBER_NS], True)


@pytest.mark.parametrize(
    "stamp",
    ["Mi 24.12.2025 08:00:00", "Mittwoch, 24.12.2025 08:00:00", "Wed 12/24/2025 08:00:00", "Mer. 2025-12-24 08:00"],
)
def test_a_day_of_the_week_may_stand_before_a_date(tmp_path: Path, stamp: str) -> None:
    log, t_ns, _ = read(table(tmp_path, f"Time\tT\n{stamp}\t20\n"))
    assert (t_ns, log.absolute) == ([DECEMBER_NS], True)


def test_other_words_before_a_date_are_a_name(tmp_path: Path) -> None:
    assert list(read(table(tmp_path, "t;Ref 24.12.2025;n\n0;20;5\n1;21;6\n"))[2]) == ["Ref 24.12.2025", "n"]


@pytest.mark.parametrize(("order", "month"), [("%d/%m", 11), ("%m/%d", 6)])
def test_a_day_of_the_week_does_not_tell_day_from_month(tmp_path: Path, order: str, month: int) -> None:
    path = table(tmp_path, "Time,T\nThu 06/11/2025 08:00:00,20\n")
    with pytest.raises(UnreadableLogError, match="may begin with the day or with the month") as refusal:
        read(path)
    assert (form := f"%a {order}/%Y %H:%M:%S") in str(refusal.value)
    begin = datetime(2025, month, 17 - month, 8, tzinfo=UTC)
    assert read(path, TimeSpec(format=form))[1] == [utc_ns(begin)]


def test_24_00_is_the_end_of_a_day_and_no_later(tmp_path: Path) -> None:
    rows = "23.12.2025;24:00:00;1\n24.12.2025;08:00:00;2\n24.12.2025;24:00:01;3\n24.12.2025;25:00:00;4\n"
    log, t_ns, _ = read(table(tmp_path, f"Datum;Zeit;T\n{rows}"))
    assert t_ns == [DECEMBER_NS - 8 * 3600 * S_NS, DECEMBER_NS]
    assert [one.record for one in log.rejected] == [2, 3]


@pytest.mark.parametrize(("form", "step_s"), [("%H:%M", 60), ("%M:%S", 1)])
def test_what_may_be_both_is_asked_for_in_words_that_work(tmp_path: Path, form: str, step_s: int) -> None:
    path = table(tmp_path, "Zeit;T\n00:00;1\n00:01;2\n00:02;3\n")
    with pytest.raises(UnreadableLogError, match='"Zeit" holds "00:00", which is no whole stamp') as refusal:
        read(path)
    assert f'format = "{form}"' in str(refusal.value)
    for spec in (TimeSpec(format=form), TimeSpec(format=form, column="Zeit")):
        assert read(path, spec)[1] == [0, step_s * S_NS, 2 * step_s * S_NS]


@pytest.mark.parametrize(
    ("rows", "says", "either"),
    [(1121, "minutes and seconds", None), (1120, "hours and minutes", "05:20")],  # up to 23:59, and on
)
def test_times_that_may_be_both_are_told_by_a_late_one_anywhere_or_said(
    tmp_path: Path, rows: int, says: str, either: str | None
) -> None:
    cells = [f"{k // 60:02d}:{k % 60:02d}" for k in range(320, 320 + rows)]
    log, t_ns, _ = read(table(tmp_path, "Zeit,T\n" + "".join(f"{cell},1\n" for cell in cells)))
    assert (log.settings["time"], log.settings.get("time_either")) == (says, either)
    assert t_ns[1] - t_ns[0] == (S_NS if either is None else 60 * S_NS)


@pytest.mark.parametrize(("name", "unit_ns"), [("millis", 1_000_000), ("timestamp_us", 1000)])
@pytest.mark.parametrize("rows", [4, 300])  # before the counter begins anew: within what is looked at first, and behind
def test_a_counter_of_32_bits_that_begins_anew_goes_on(tmp_path: Path, name: str, unit_ns: int, rows: int) -> None:
    counts = [(2**32 - 100 * rows + 100 * k) % 2**32 for k in range(2 * rows)]
    log, t_ns, _ = read(table(tmp_path, f"{name},T\n" + "".join(f"{count},1\n" for count in counts)))
    assert t_ns == [(2**32 - 100 * rows + 100 * k) * unit_ns for k in range(2 * rows)]
    assert (log.settings["counter_wraps"], log.settings["backward_steps"]) == (1, 0)


@pytest.mark.parametrize(("head", "step_s"), [("Zeit;T", 1), ("Datum;T", 600)])
def test_dates_as_spreadsheets_store_them_are_local_days(tmp_path: Path, head: str, step_s: int) -> None:
    days = [45_964 + k * step_s / 86_400 for k in range(5)]  # 2025-11-03
    rows = "".join(f"{day:.8f};1\n".replace(".", ",") for day in days)
    log, t_ns, _ = read(table(tmp_path, head + "\n" + rows), TimeSpec(zone="Europe/Rome"))
    begin = utc_ns(datetime(2025, 11, 3, tzinfo=ZoneInfo("Europe/Rome")))
    np.testing.assert_allclose(np.array(t_ns) - begin, np.arange(5) * step_s * S_NS, atol=500_000)
    assert log.absolute and log.settings["time"] == "days since 1899-12-30 in Europe/Rome"


def test_large_seconds_are_no_dates_of_a_spreadsheet(tmp_path: Path) -> None:
    log, t_ns, _ = read(table(tmp_path, "Time,T\n45964.0,1\n45965.0,2\n"))
    assert (t_ns, log.absolute) == ([45_964 * S_NS, 45_965 * S_NS], False)


@pytest.mark.parametrize("head", ["Date,Time,Millisecond,T", "Date&Time,,ms,T", "Date,Time,Millisecondes,T"])
def test_milliseconds_in_a_column_of_their_own_belong_to_the_stamp(tmp_path: Path, head: str) -> None:
    blank = "," if head.startswith("Date,") else " "
    rows = [f"2025/12/24{blank}08:00:0{k // 2},{500 * (k % 2)},20" for k in range(4)]
    log, t_ns, columns = read(table(tmp_path, "\n".join([head.replace(",,", ","), *rows, ""])))
    assert t_ns == [DECEMBER_NS + k * S_NS // 2 for k in range(4)]
    assert list(columns) == ["T"] and log.settings["time_column"].endswith(head.split(",")[2])


def test_a_stamp_without_signs_is_a_date_and_no_number(tmp_path: Path) -> None:
    for stamp in ("20251224080000", "20251224T080000Z", "20251224_080000"):
        log, t_ns, _ = read(table(tmp_path, f"Time,T\n{stamp},20\n"))
        assert (t_ns, log.absolute) == ([DECEMBER_NS], True)


def test_a_short_year_may_stand_first_and_is_asked_for(tmp_path: Path) -> None:
    path = table(tmp_path, "Time,T\n25/12/24 08:00:00,1\n")
    with pytest.raises(
        UnreadableLogError, match=r'day or with the year\. .* format = "%d/%m/%y .* "%y/%m/%d %H:%M:%S"'
    ):
        read(path)
    assert read(path, TimeSpec(format="%y/%m/%d %H:%M:%S"))[1] == [DECEMBER_NS]
    assert read(table(tmp_path, "Time;T\n24/12/25 08:00:00;1,5\n"))[1] == [DECEMBER_NS]


def test_rows_at_a_fixed_rate_keep_their_place(tmp_path: Path) -> None:
    path = table(tmp_path, "T\n20\n21\nabc\n22\n23\n")
    log, t_ns, _ = read(path, TimeSpec(rate_hz=2.0))
    assert (t_ns, log.absolute) == ([0, S_NS // 2, 3 * S_NS // 2, 2 * S_NS], False)
    log, t_ns, _ = read(path, TimeSpec(rate_hz=2.0, start_ns=1_709_280_000_000_000_000))
    assert (t_ns[0], log.absolute) == (MARCH_NS, True)


def test_a_stated_column_counts_from_the_stated_start(tmp_path: Path) -> None:
    path = table(tmp_path, "T,clock\n20,10\n21,20\n")
    log, t_ns, columns = read(path, TimeSpec(column="clock", unit="ms", start_ns=1_709_280_000_000_000_000))
    assert (t_ns, log.absolute, list(columns)) == ([MARCH_NS + 10_000_000, MARCH_NS + 20_000_000], True, ["T"])


@pytest.mark.parametrize(
    ("form", "cell", "seconds"),
    [
        ("%d.%m.%Y %H:%M:%S", "1.3.2024 8:00:01", 1),
        ("%m/%d/%y %I:%M:%S %p", "03/01/24 08:00:01 AM", 1),
        ("%m/%d/%y %I:%M:%S %p", "03/01/24 12:00:01 pm", 4 * 3600 + 1),
        ("%Y%m%d%H%M%S", "20240301080001", 1),
        ("%d %b %Y %H:%M:%S.%f", "01 Mar 2024 08:00:01.000", 1),
        ("%Y-%m-%dT%H:%M:%S%z", "2024-03-01T08:00:01-02:00", 7201),
        ("%B %d, %Y %H:%M:%S", "March 01, 2024 08:00:01", 1),
    ],
)
def test_a_stated_format_is_read(tmp_path: Path, form: str, cell: str, seconds: int) -> None:
    path = table(tmp_path, f"when;T\n{cell};20\n{cell};21\n")
    log, t_ns, _ = read(path, TimeSpec(column="when", format=form))
    assert t_ns == [MARCH_NS + seconds * S_NS] * 2 and log.absolute


@pytest.mark.parametrize(
    "cells", [("01.03.2024", "13.03.2024"), ("3/1/2024", "3/13/2024"), ("2024-03-01", "2024-03-13")]
)
def test_days_alone_are_stamps_where_their_column_is_named(tmp_path: Path, cells: tuple[str, str]) -> None:
    path = table(tmp_path, "Datum,R\n" + "".join(f"{cell},0.05\n" for cell in cells))
    _, t_ns, _ = read(path, TimeSpec(column="Datum"))
    assert t_ns == [MARCH_NS - 8 * 3600 * S_NS + days * 24 * 3600 * S_NS for days in (0, 12)]
    path = table(tmp_path, "Datum,Uhrzeit,T\n" + "".join(f"{cell},08:00:00,20\n" for cell in cells))
    with pytest.raises(UnreadableLogError, match="format = "):  # a log's time of day stands beside them
        read(path, TimeSpec(column="Datum"))


@pytest.mark.parametrize("cell", ["31.02.2024 08:00:00", "01.13.2024 08:00:00", "01.03.2024 25:00:00", "gestern", ""])
def test_a_stamp_that_is_none_is_rejected(tmp_path: Path, cell: str) -> None:
    path = table(tmp_path, f"Zeit;T\n01.03.2024 08:00:00;20\n{cell};21\n01.03.2024 08:00:02;20\n")
    log, t_ns, _ = read(path, TimeSpec(column="Zeit", format="%d.%m.%Y %H:%M:%S"))
    assert t_ns == [MARCH_NS, MARCH_NS + 2 * S_NS]
    assert [entry.where for entry in log.rejected] == ["line 3, column Zeit"]


@pytest.mark.parametrize(
    ("spec", "says"),
    [
        (
            TimeSpec(column="Tiem"),
            'column = "Tiem" under [time] of the bench file is none of the table. Nearest: Time.',
        ),
        (TimeSpec(column="T"), 'column "T" holds "warm", which is no number and no stamp that is known. Say format ='),
        (
            TimeSpec(column="Time", format="%d.%m. %H:%M"),
            'format = "%d.%m. %H:%M" under [time] of the bench file holds no whole date.',
        ),
        (TimeSpec(column="Time", format="%Y-%W"), 'format = "%Y-%W" under [time] of the bench file holds %W, which is'),
    ],
)
def test_a_stated_time_that_cannot_be_is_refused(tmp_path: Path, spec: TimeSpec, says: str) -> None:
    with pytest.raises(UnreadableLogError) as refused:
        read(table(tmp_path, "Time,T\n0,warm\n1,warm\n"), spec)
    assert str(refused.value).startswith(f"log.csv: {says}")


def test_steps_back_in_time_are_kept_and_counted(tmp_path: Path) -> None:
    log, t_ns, _ = read(table(tmp_path, "time,T\n" + "".join(f"{n},20\n" for n in (*range(20), 18, 19, 20, 10, 11))))
    assert len(t_ns) == 25 and log.settings["backward_steps"] == 2


def test_local_stamps_are_converted_on_both_sides_of_summer_time(tmp_path: Path) -> None:
    stamps = ["2024-03-31 01:59:59", "2024-03-31 03:00:00", "2024-03-31 03:00:01"]
    path = table(tmp_path, "time,T\n" + "".join(f"{stamp},20\n" for stamp in stamps))
    log, t_ns, _ = read(path, TimeSpec(zone="Europe/Rome"))
    assert np.diff(t_ns).tolist() == [S_NS, S_NS]
    assert "ambiguous_rows" not in log.settings


def test_the_hour_that_comes_twice_is_told_by_the_step_back(tmp_path: Path) -> None:
    local = ["01:59:59", "02:00:00", "02:59:59", "02:00:00", "02:59:59", "03:00:00"]
    path = table(tmp_path, "time,T\n" + "".join(f"2024-10-27 {clock},20\n" for clock in local))
    log, t_ns, _ = read(path, TimeSpec(zone="Europe/Rome"))
    assert np.diff(t_ns).tolist() == [S_NS, 3599 * S_NS, S_NS, 3599 * S_NS, S_NS]
    assert (log.settings["ambiguous_rows"], log.settings["backward_steps"]) == (4, 0)


@pytest.mark.parametrize("time", [TimeSpec(), TimeSpec(column="time", format="%d.%m.%Y %H:%M:%S")])
def test_a_time_that_does_not_exist_is_rejected_with_the_reason(tmp_path: Path, time: TimeSpec) -> None:
    local = ["01:59:59", "02:00:00", "02:30:00", "25:00:00", "03:00:00"]
    path = table(tmp_path, "time,T\n" + "".join(f"31.03.2024 {clock},20\n" for clock in local))
    log, t_ns, _ = read(path, replace(time, zone="Europe/Rome"))
    assert np.diff(t_ns).tolist() == [S_NS]
    gone = "does not exist in Europe/Rome on that day (clocks went forward)"
    assert [(entry.where, entry.why) for entry in log.rejected[:2]] == [
        ("line 3, column time", f"02:00:00 {gone}"),
        ("line 4, column time", f"02:30:00 {gone}"),
    ]
    assert log.rejected[2].why.startswith('"31.03.2024 25:00:00" is no time (')


def test_a_stamp_with_its_own_offset_exists_whatever_the_zone(tmp_path: Path) -> None:
    path = table(tmp_path, "time,T\n2024-03-31T02:30:00+01:00,20\n2024-03-31T02:30:00,20\n")
    log, t_ns, _ = read(path, TimeSpec(zone="Europe/Rome"))
    assert len(t_ns) == 1 and log.rejected[0].why.startswith("02:30:00 does not exist in Europe/Rome")


@pytest.mark.parametrize(
    "stamp",
    [
        *("24.12.2025 08:00:0{}", "24.12.25 08:00:0{}", "24.12.2025, 08:00:0{}", "24.12.2025T08.00.0{}"),
        *("24/12/2025 08.00.0{}", "24/12/25 08:00:0{}", "24/12/2025  8:00:0{},000"),
        *("24-dic-2025 08.00.0{}", "24 dicembre 2025 08:00:0{}", "24/dic/25 08.00.0{}"),
        *("24. Dez. 2025 08:00:0{}", "24. Dezember 2025 08:00:0{}", "24.Dez.2025 08:00:0{}", "24-Dec-2025 08:00:0{}"),
    ],
)
@pytest.mark.parametrize("encoding", ["utf-8", "cp1252"])
def test_german_and_italian_stamps_are_recognised(tmp_path: Path, stamp: str, encoding: str) -> None:
    rows = "".join(f"{stamp.format(i)};{230 + i},5\n" for i in range(3))
    log, t_ns, columns = read(table(tmp_path, f"Öfen;T\n;°C\n{rows}", encoding=encoding))
    assert t_ns == [DECEMBER_NS + i * S_NS for i in range(3)]
    assert (columns, log.units, log.absolute) == ({"T": [230.5, 231.5, 232.5]}, {"T": "°C"}, True)


@pytest.mark.parametrize(
    ("names", "month"),
    [
        ("gen Jan January gennaio Januar Jänner", 1), ("feb Februar febbraio", 2), ("mar März Mrz Maerz marzo", 3),
        ("apr aprile", 4), ("mag Mai May maggio", 5), ("giu Juni June giugno", 6), ("lug Juli July luglio", 7),
        ("ago Aug August agosto", 8), ("set Sep September settembre", 9), ("ott Okt Oct ottobre", 10),
        ("nov November novembre", 11), ("dic Dez Dec", 12),
    ],
)  # fmt: skip
def test_months_have_german_italian_and_english_names(tmp_path: Path, names: str, month: int) -> None:
    for name in names.split():
        _, t_ns, _ = read(table(tmp_path, f"Zeit;T\n01. {name} 2025 08:00:00;1,5\n"))
        assert str(np.array(t_ns, "M8[ns]")[0])[:10] == f"2025-{month:02d}-01", name


def test_a_name_of_no_month_is_rejected(tmp_path: Path) -> None:
    log, t_ns, _ = read(table(tmp_path, "Zeit;T\n24-dic-2025 08:00:00;1,5\n25-xyz-2025 08:00:00;1,5\n"))
    assert t_ns == [DECEMBER_NS]
    assert [entry.why for entry in log.rejected] == ['"25-xyz-2025 08:00:00" is no time (day month year in UTC)']


@pytest.mark.parametrize(
    ("head", "row"),
    [
        ("Datum;Uhrzeit", "24.12.2025;08:00:0{}"),
        ("Data;Ora", "24/12/2025;08.00.0{}"),
        ("Data;Ora", "24-dic-2025;08.00.0{}"),
        ("Datum;Uhrzeit", "24.12.25;08.00.0{}"),
        ("Uhrzeit;Datum", "08:00:0{};24.12.2025"),
        ("Datum;Uhrzeit", "2025-12-24;08:00:0{}"),
    ],
)
def test_date_and_time_of_day_may_stand_in_two_columns(tmp_path: Path, head: str, row: str) -> None:
    log, t_ns, columns = read(table(tmp_path, f"{head};T\n" + "".join(f"{row.format(i)};230,5\n" for i in range(3))))
    assert t_ns == [DECEMBER_NS + i * S_NS for i in range(3)]
    assert columns == {"T": [230.5] * 3}
    day, clock = sorted(head.split(";"), key=lambda name: name not in ("Datum", "Data"))
    assert log.settings["time_column"] == f"{day} + {clock}"


def test_a_row_without_its_time_of_day_is_rejected_and_a_stated_format_takes_both_columns(tmp_path: Path) -> None:
    path = table(tmp_path, "Data;Ora;T\n" + "12/24/2025;08.00.00;1,5\n" * 3 + "12/24/2025;;1,5\n;;1,5\n")
    log, t_ns, _ = read(path, TimeSpec(format="%m/%d/%Y %H.%M.%S"))
    assert t_ns == [DECEMBER_NS] * 3
    assert [(entry.where, entry.why) for entry in log.rejected] == [
        ("line 5, column Data + Ora", '"12/24/2025 " is no time (%m/%d/%Y %H.%M.%S in UTC)'),
        ("line 6, column Data + Ora", "no time"),
    ]


@pytest.mark.parametrize(
    ("first", "later", "day"),
    [
        ("05/06/2025 08:00:00", "13/06/2025 08:00:00", "2025-06-05"),
        ("05/06/2025 08:00:00", "06/13/2025 08:00:00", "2025-05-06"),
        ("5/6/25 8:00 AM", "6/13/25 8:00 AM", "2025-05-06"),
        ("05/06/2025 08:00:00 am", "45/06/2025 08:00:00 am", None),  # is no day
    ],
)
@pytest.mark.parametrize("rows", [1, 500])  # of the first kind: more than are looked at to recognise all else
def test_a_day_above_12_anywhere_tells_the_order_of_dates(
    tmp_path: Path, first: str, later: str, day: str | None, rows: int
) -> None:
    path = table(tmp_path, "Time,T\n" + f"{first},1\n" * rows + f"{later},1\n")
    if day is None:
        with pytest.raises(UnreadableLogError, match="no row has a day above 12"):
            read(path)
        return
    log, t_ns, _ = read(path)
    assert (str(np.array(t_ns, "M8[ns]")[0])[:10], log.found, list(log.rejected)) == (day, rows + 1, [])
    assert log.settings["time"] == ("day/month/year in UTC" if day == "2025-06-05" else "month/day/year in UTC")


def test_a_date_with_slashes_begins_with_the_day_in_a_european_table(tmp_path: Path) -> None:
    _, t_ns, _ = read(table(tmp_path, "Time;T\n05/06/2025 08:00:00;1,5\n"))
    assert str(np.array(t_ns, "M8[ns]")[0])[:10] == "2025-06-05"
    with pytest.raises(UnreadableLogError, match="may begin with the day or with the month"):
        read(table(tmp_path, "Time;T\n05/06/2025 08:00:00 AM;1.5\n"))


@pytest.mark.parametrize(
    ("head", "stamp", "form"),
    [
        ("Time", "05/06/2025 08:00:00", "{}/%Y %H:%M:%S"),
        ("when", "5/6/25, 7:00 PM", "{}/%y, %I:%M %p"),
        ("Time", "05/06/2025 08:00:00.250", "{}/%Y %H:%M:%S.%f"),
        ("Date,Clock", "05/06/2025,08:00:00", "{}/%Y %H:%M:%S"),
    ],
)
def test_dates_that_may_be_of_either_order_are_asked_for_in_words_that_work(
    tmp_path: Path, head: str, stamp: str, form: str
) -> None:
    quoted = stamp if "," in head else f'"{stamp}"'
    path = table(tmp_path, f"{head},T\n{quoted},1.5\n{quoted},2.5\n")
    with pytest.raises(UnreadableLogError) as refused:
        read(path)
    both = [form.format(order) for order in ("%d/%m", "%m/%d")]
    name, cell = head.replace(",", " + "), stamp.replace("5,0", "5 0")
    assert str(refused.value) == (
        f'log.csv: "{name}" holds "{cell}", which may begin with the day or with the month, and no row has a day above '
        f'12. Under [time] of the bench file say format = "{both[0]}" or format = "{both[1]}".'
    )
    days = [str(np.array(read(path, TimeSpec(format=one))[1], "M8[ns]")[0])[:10] for one in both]
    assert days == ["2025-06-05", "2025-05-06"]


@pytest.mark.parametrize(
    ("clock", "wanted"),
    [("8:00:01 AM", "08:00:01"), ("12:00:01 am", "00:00:01"), ("12:30 PM", "12:30:00"), ("11:59:59.5pm", "23:59:59.5")],
)
def test_a_clock_of_twelve_hours_is_read(tmp_path: Path, clock: str, wanted: str) -> None:
    for date in ("2025-12-24", "12/24/2025", "24 Dec 2025", "2025/12/24"):
        _, t_ns, _ = read(table(tmp_path, f"Time,T\n{date} {clock},1\n{date} {clock},1\n"))
        assert str(np.array(t_ns, "M8[ns]")[0]).startswith(f"2025-12-24T{wanted}"), date
    log, _, _ = read(table(tmp_path, "Time,T\n12/24/2025 1:00 PM,1\n12/24/2025 13:00 PM,1\n"))
    assert [one.why for one in log.rejected] == ['"12/24/2025 13:00 PM" is no time (month/day/year in UTC)']


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("time,T\n28-11-2026 14:05:06,20\n28-11-2026 14:05:07,21\n", "day/month/year in UTC"),
        ("time,T\n11-28-2026 14:05:06,20\n11-28-2026 14:05:07,21\n", "month/day/year in UTC"),
    ],
)
def test_dates_with_dashes_are_told_by_a_day_above_12(tmp_path: Path, text: str, told: str) -> None:
    log, t_ns, _ = read(table(tmp_path, text))
    assert (log.settings["time"], t_ns[0]) == (told, 1_795_874_706 * S_NS)


@pytest.mark.parametrize("delimiter", [",", ";"])
def test_a_date_with_dashes_that_may_begin_with_the_year_is_asked_for(tmp_path: Path, delimiter: str) -> None:
    text = "time,T\n26-11-28 14:05:06.000,20\n26-11-28 14:05:07.000,21\n".replace(",", delimiter)
    with pytest.raises(UnreadableLogError, match=r'say format = "%d-%m-%y %H:%M:%S.%f" or format = "%y-%m-%d %H'):
        read(table(tmp_path, text))


def test_seconds_since_1904_are_those_of_labview(tmp_path: Path) -> None:
    log, t_ns, _ = read(table(tmp_path, "Time,T\n3878719506.5,20\n3878719507.5,21\n"))
    assert (log.settings["time"], t_ns[0]) == ("s since 1904", 1_795_874_706 * S_NS + S_NS // 2)


def test_the_time_of_catman_is_known_by_its_name(tmp_path: Path) -> None:
    log, t_ns, columns = read(table(tmp_path, "Zeit  1 - Standardmessrate\tT_W\ns\t°C\n0,0\t20,5\n0,5\t21,5\n"))
    assert (log.settings["time"], t_ns, columns["T_W"]) == ("s from the start", [0, S_NS // 2], [20.5, 21.5])


@pytest.mark.parametrize(
    ("stamp", "utc_hour"),
    [
        ("2024-03-01 10:00:00+01", 9),
        ("2024-03-01 10:00:00.000 UTC", 10),
        ("2024-03-01 10:00:00 CET", 9),
        ("2024-03-01 10:00:00 GMT-5", 15),
        ("01.03.2024 10:00:00 +01:30", 8.5),
        ("13/03/2024 10:00:00 p. m.", 22),
        ("3/13/2024, 12:00:00\u202fAM", 0),
        ("'24-03-01 10:00:00.0", 10),
        ("1 févr. 2024 10:00:00", 10),
        ("1 juin 2024 10:00:00", 10),
        ("1 juillet 2024 10:00:00", 10),
        ("15-ago-2024 10:00:00", 10),
    ],
)
def test_stamps_have_zones_halves_of_the_day_and_months_in_many_spellings(
    tmp_path: Path, stamp: str, utc_hour: float
) -> None:
    log, t_ns, columns = read(table(tmp_path, f"Time;T\n{stamp};20\n{stamp};21\n"))
    assert (columns["T"], log.absolute, list(log.rejected)) == ([20, 21], True, [])
    assert t_ns[0] % (86_400 * S_NS) == utc_hour * 3600 * S_NS


def test_a_month_of_four_letters_is_no_other_one(tmp_path: Path) -> None:
    _, t_ns, _ = read(table(tmp_path, "Temps;T\n1 juin 2024 10:00:00;20\n1 juil. 2024 10:00:00;21\n"))
    assert t_ns[1] - t_ns[0] == 30 * 86_400 * S_NS


@pytest.mark.parametrize("name", ["Temps", "Temps [s]", "Tiempo (s)"])
def test_time_has_its_french_and_spanish_names(tmp_path: Path, name: str) -> None:
    _, t_ns, _ = read(table(tmp_path, f"{name};Étuve\n0,5;20\n1,0;21\n"))
    assert t_ns == [S_NS // 2, S_NS]


def test_dates_and_times_of_day_may_be_a_number_each_as_spreadsheets_store_them(tmp_path: Path) -> None:
    rows = "45352;0,999988426;20\n45353;0;21\n45353;0,5;22\n"
    log, t_ns, columns = read(table(tmp_path, f"Datum;Zeit;T\n{rows}"))
    assert (log.absolute, log.settings["time_column"], list(columns)) == (True, "Datum + Zeit", ["T"])
    first = utc_ns(datetime(2024, 3, 1, 23, 59, 59, tzinfo=ZoneInfo("UTC")))
    assert [round((t - first) / 1e9, 3) for t in t_ns] == [0, 1, 43_201]
    assert read(table(tmp_path, "Datum;Zeit;T\n45352;0,5;20\n45352;1,5;21\n"))[1] == [S_NS // 2, 3 * S_NS // 2]


@pytest.mark.parametrize(
    ("unit", "second_ns"),
    [
        ("Min", 60 * S_NS), ("min.", 60 * S_NS), ("minutes", 60 * S_NS), ("hr", 3600 * S_NS), ("Std", 3600 * S_NS),
        ("heures", 3600 * S_NS), ("MS", S_NS // 1000), ("msec", S_NS // 1000), ("usec", 1000), ("Sek.", S_NS),
        ("days", 86_400 * S_NS),
    ],
)  # fmt: skip
def test_units_of_time_are_known_as_people_spell_them_in_a_row_and_in_a_name(
    tmp_path: Path, unit: str, second_ns: int
) -> None:
    assert read(table(tmp_path, f"Zeit;T\n{unit};°C\n0;20\n1;21\n"))[1] == [0, second_ns]
    assert read(table(tmp_path, f"Zeit [{unit}];T\n0;20\n1;21\n"))[1] == [0, second_ns]
    assert read(table(tmp_path, f"Time ({unit});T\n0;20\n1;21\n"))[1] == [0, second_ns]
