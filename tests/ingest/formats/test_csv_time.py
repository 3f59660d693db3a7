"""The time of tables: which column holds it, what its cells mean, and what is asked where they may mean two things."""

from datetime import datetime
from pathlib import Path
from zoneinfo import ZoneInfo

import numpy as np
import pytest

from ingest.errors import UnreadableLogError
from ingest.formats import TimeSpec, utc_ns
from ingest.log import unread
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


def test_whole_seconds_since_1970_and_their_parts_may_be_called_so(tmp_path: Path) -> None:
    rows = "".join(f"{MARCH_NS // S_NS + k // 2},{k % 2 * 500_000_000},20\n" for k in range(4))
    _, t_ns, columns = read(table(tmp_path, f"header.stamp.sec,header.stamp.nanosec,T\n{rows}"))
    assert (t_ns, list(columns)) == ([MARCH_NS + k * S_NS // 2 for k in range(4)], ["T"])


@pytest.mark.parametrize(
    ("name", "cells"),
    [("Run time (h)", "10 10 11"), ("Run time (h)", "10 11 10"), ("ageing hours", "10 11 12"), ("Secondary", "1 2 3")],
)
def test_one_that_does_not_go_on_in_each_row_or_counts_what_aged_is_none(tmp_path: Path, name: str, cells: str) -> None:
    with pytest.raises(UnreadableLogError, match="no column is recognised as its time"):
        read(table(tmp_path, f"T;{name}\n" + "".join(f"20;{cell}\n" for cell in cells.split())))


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


@pytest.mark.parametrize(
    ("head", "step", "said"),
    [
        ("timestamp", 1_000_000, True),  # of PX4, in us
        ("time", 100, True),
        ("time", 3600, False),
        ("time", 99, False),
        ("time", 100.5, False),
        ("time_s", 1000, False),
    ],
)
def test_whole_numbers_without_a_unit_that_go_on_by_much_are_said_to_be_read_as_seconds(
    tmp_path: Path, head: str, step: float, said: bool
) -> None:
    path = table(tmp_path, f"{head},T\n" + "".join(f"{7 + k * step},20\n" for k in range(3)))
    log, t_ns, _ = read(path)
    assert t_ns[1] - t_ns[0] == step * S_NS
    says = [one.says for one in unread.findings("log.csv", log.settings)]
    start = f"log.csv: its times say no unit, go on by {step:,.0f} from row to row, and are read as seconds"
    assert [one[: len(start)] for one in says] == [start] * said
    assert unread.findings("log.csv", read(path, TimeSpec(unit="us"))[0].settings) == []


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


def test_seconds_since_1904_are_those_of_labview(tmp_path: Path) -> None:
    log, t_ns, _ = read(table(tmp_path, "Time,T\n3878719506.5,20\n3878719507.5,21\n"))
    assert (log.settings["time"], t_ns[0]) == ("s since 1904", 1_795_874_706 * S_NS + S_NS // 2)


def test_the_time_of_catman_is_known_by_its_name(tmp_path: Path) -> None:
    log, t_ns, columns = read(table(tmp_path, "Zeit  1 - Standardmessrate\tT_W\ns\t°C\n0,0\t20,5\n0,5\t21,5\n"))
    assert (log.settings["time"], t_ns, columns["T_W"]) == ("s from the start", [0, S_NS // 2], [20.5, 21.5])


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
