"""Stamps in the cells of tables: their dates, zones and columns, and what is asked where they may mean two things."""

from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from ingest.errors import UnreadableLogError
from ingest.formats import TimeSpec, utc_ns
from made.tables import DECEMBER_NS, MARCH_NS, S_NS, read, table


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


@pytest.mark.parametrize("clock", ["140000.25", "080000", "0800"])
def test_a_short_date_in_digits_is_asked_for_in_words_that_work(tmp_path: Path, clock: str) -> None:
    path = table(tmp_path, f"UTC Date,UTC Time,T\n140325,{clock},20\n140325,{clock},21\n")
    with pytest.raises(UnreadableLogError, match=r"may begin with the day, the month or the year") as refusal:
        read(path)
    form = str(refusal.value).split('format = "')[1].split('"')[0]
    (first, _), log = (found := read(path, TimeSpec(format=form)))[1], found[0]
    assert log.absolute and first % (86_400 * S_NS) == (50_400_250_000_000 if "." in clock else 28_800 * S_NS)


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
        *("2025年12月24日 8:00:00", "2025-358T08:00:00Z", "2025:358:08:00:00.000", "24.12.2025 08:00:00;000"),
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


def test_a_day_of_the_year_ends_with_it(tmp_path: Path) -> None:
    rows = "2024-366T08:00:00,1\n2025-001T08:00:00,2\n2025-366T08:00:00,3\n2025-000T08:00:00,4\n"
    log, t_ns, _ = read(table(tmp_path, f"Time,T\n{rows}"))
    assert [str(day)[:10] for day in np.array(t_ns, "M8[ns]")] == ["2024-12-31", "2025-01-01"]
    assert [one.record for one in log.rejected] == [2, 3]


def test_24_00_is_the_end_of_a_day_and_no_later(tmp_path: Path) -> None:
    rows = "23.12.2025;24:00:00;1\n24.12.2025;08:00:00;2\n24.12.2025;24:00:01;3\n24.12.2025;25:00:00;4\n"
    log, t_ns, _ = read(table(tmp_path, f"Datum;Zeit;T\n{rows}"))
    assert t_ns == [DECEMBER_NS - 8 * 3600 * S_NS, DECEMBER_NS]
    assert [one.record for one in log.rejected] == [2, 3]


@pytest.mark.parametrize("head", ["Date,Time,Millisecond,T", "Date&Time,,ms,T", "Date,Time,Millisecondes,T"])
def test_milliseconds_in_a_column_of_their_own_belong_to_the_stamp(tmp_path: Path, head: str) -> None:
    blank = "," if head.startswith("Date,") else " "
    rows = [f"2025/12/24{blank}08:00:0{k // 2},{500 * (k % 2)},20" for k in range(4)]
    log, t_ns, columns = read(table(tmp_path, "\n".join([head.replace(",,", ","), *rows, ""])))
    assert t_ns == [DECEMBER_NS + k * S_NS // 2 for k in range(4)]
    assert list(columns) == ["T"] and log.settings["time_column"].endswith(head.split(",")[2])


def test_a_fraction_of_a_second_in_a_column_of_its_own_belongs_to_the_stamp(tmp_path: Path) -> None:
    parts = ("0.05", "0.5", ".75", "0")
    rows = [f"{20 + k},2025/12/24,08:00:0{k},{part}" for k, part in enumerate(parts)]
    log, t_ns, columns = read(table(tmp_path, "\n".join(["T,Date,Time,Fractional Seconds", *rows, ""])))
    assert t_ns == [DECEMBER_NS + k * S_NS + round(float(part) * S_NS) for k, part in enumerate(parts)]
    assert list(columns) == ["T"] and not log.rejected


def test_a_stamp_without_signs_is_a_date_and_no_number(tmp_path: Path) -> None:
    for stamp in ("20251224080000", "20251224T080000Z", "20251224_080000", "20251224080000000"):
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


@pytest.mark.parametrize("rows", [1, 500])
def test_a_date_that_is_the_same_either_way_is_asked_nothing(tmp_path: Path, rows: int) -> None:
    text = "Time,T\n" + "3/3/2025 08:00:00,1\n" * rows
    t_ns = read(table(tmp_path, text))[1]
    assert (str(np.array(t_ns, "M8[ns]")[0])[:10], len(t_ns)) == ("2025-03-03", rows)
    for other in (text + "3/4/2025 08:00:00,1\n", "Time,T\n3/3/25 08:00:00,1\n"):  # which may be of 2003 as well
        with pytest.raises(UnreadableLogError, match="may begin with the day or with the"):
            read(table(tmp_path, other))


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
