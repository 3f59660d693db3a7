"""Every file that a session is exported to, read again by a program that did not write it."""

from __future__ import annotations

import csv
import errno
import re
import struct
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from datetime import UTC, datetime
from itertools import chain
from pathlib import Path

import duckdb
import numpy as np
import pyarrow as pa
import pytest
from mcap.reader import make_reader
from numpy.typing import NDArray
from openpyxl import load_workbook
from python_calamine import CalamineWorkbook
from rerun.chunk import McapReader

from ingest.catalogue.channels import load
from ingest.facts import facts as ledger_facts
from ingest.facts.store import Store
from ingest.formats import Rows, open_log
from made import can_bench
from replay.cli import main
from replay.exports import export, samples, xlsx
from replay.exports.samples import OutColumn, SessionRows, session_rows

Floats = NDArray[np.float64]
Read = Mapping[str, tuple[Floats, Floats]]  # channel -> its stamps [s since 1970, or since the start] and values
NASTY = '=1+1,"-x;y",T_Rücken\n'
SAMPLE = "whyhot.Sample:message"  # what rerun calls a message
NAMES = ("=1+1", "-x;y", "T_Rücken")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A store with a log of two rates by a bench file, and a table without a date whose columns have odd names."""
    folder = tmp_path_factory.mktemp("export")
    can_bench.write_files(folder)
    can_bench.write_log(folder / "can.blf", seconds=60)
    rows = [f"{i / 10:.1f},{i % 7},{-i},{20 + i / 100}" for i in range(50)]
    (folder / "odd.csv").write_text("t_s," + NASTY + "\n".join(rows) + "\n", encoding="utf-8")
    words, store = ["--bench", str(folder / "bench.toml"), "--dbc", str(folder / "bench.dbc")], str(folder / "store")
    assert main(["ingest", str(folder / "can.blf"), *words, "--store", store]) == 0
    assert main(["ingest", str(folder / "odd.csv"), "--store", store]) == 0
    return folder


def exported(folder: Path, out: Path, *words: str, session: str = "can", code: int = 0) -> Path:
    assert main(["export", session, *words, "-o", str(out), "--store", str(folder / "store")]) == code
    return out


def recorded(folder: Path, session: str) -> Read:
    """What replays read of a session."""
    with Store.open(folder / "store") as store:
        facts = ledger_facts.at(store.ledger)
        one = facts.session(session)
        start_ns = 0 if one.absolute else one.start_ns
        return {c.spec.name: ((c.t_ns - start_ns) / 1e9, c.value) for c in load(store, facts, one)}


def of_columns(names: list[str], rows: list[list[float]]) -> Read:
    """A table whose first column is the time; empty cells are NaN."""
    table = np.array(rows, np.float64)
    there = ~np.isnan(table)
    return {name: (table[there[:, i], 0], table[there[:, i], i]) for i, name in enumerate(names) if i}


def _named(titles: list[str]) -> list[str]:
    """The names of titles such as "TC_winding [degC]"."""
    return [title.removeprefix("'").split(" [")[0] for title in titles]


def by_csv(path: Path, excel: str = "") -> Read:
    with path.open(encoding="utf-8-sig" if excel else "utf-8", newline="") as file:
        titles, *lines = csv.reader(file, delimiter=";" if excel else ",")
    names, first = _named(titles), 1 if titles[0] == "time_utc" else 0

    def seconds(text: str) -> float:
        if excel:
            return datetime.strptime(text, "%d.%m.%Y %H:%M:%S,%f").replace(tzinfo=UTC).timestamp()
        return datetime.fromisoformat(text).timestamp()

    def number(text: str) -> float:
        return float(text.replace(",", ".") if excel else text) if text else np.nan

    rows = [[seconds(line[0]) if first else number(line[0]), *map(number, line[1 + first :])] for line in lines]
    return of_columns(["t", *names[1 + first :]], rows)


def by_german_excel(path: Path) -> Read:
    assert path.read_bytes().startswith(b"\xef\xbb\xbf") and b"\r\n" in path.read_bytes()
    return by_csv(path, "de")


def by_openpyxl(path: Path) -> Read:
    with closing(load_workbook(path, read_only=True)) as book:
        sheets = [list(sheet.iter_rows(values_only=True)) for sheet in book]
    return _of_cells([list(line) for line in sheets[0][:1] + list(chain.from_iterable(sheet[1:] for sheet in sheets))])


def by_calamine(path: Path) -> Read:
    return _of_cells(CalamineWorkbook.from_path(path).get_sheet_by_index(0).to_python())


def _of_cells(lines: Sequence[Sequence[object]]) -> Read:
    titles, first = [str(cell) for cell in lines[0]], 1 if lines[0][0] == "time_utc" else 0

    def number(cell: object) -> float:
        if isinstance(cell, datetime):
            return cell.replace(tzinfo=UTC).timestamp()
        return float(str(cell)) if cell not in (None, "") else np.nan

    rows = [[number(line[0]), *map(number, line[1 + first :])] for line in lines[1:]]
    return of_columns(["t", *_named(titles)[1 + first :]], rows)


def ask(sql: str) -> duckdb.DuckDBPyRelation:
    found = duckdb.sql(sql)
    assert found is not None
    return found


def by_duckdb(path: Path) -> Read:
    found = ask(f"SELECT * FROM '{path}'")
    if found.columns[0] == "time_utc":
        found = ask(f"SELECT epoch_ns(time_utc) / 1e9 AS t, * EXCLUDE (time_utc, t_s) FROM '{path}'")
    rows = [[np.nan if cell is None else cell for cell in line] for line in found.fetchall()]
    return of_columns(found.columns, rows)


def by_rerun(path: Path) -> Read:
    """The numbers of each message, which rerun finds by the schema in the file and draws as curves."""
    found: dict[str, list[tuple[float, float]]] = {}
    for chunk in McapReader(path).stream():
        table = chunk.to_record_batch()
        if SAMPLE in table.schema.names:
            name = re.sub(r"\\(.)", r"\1", str(chunk.entity_path)).removeprefix("/samples/")
            t_ns = table["message_log_time"].cast(pa.int64()).to_pylist()
            values = [one[0]["value"] for one in table[SAMPLE].to_pylist()]
            found.setdefault(name, []).extend((at / 1e9, value) for at, value in zip(t_ns, values, strict=True))
    return {name: (np.array(sorted(own))[:, 0], np.array(sorted(own))[:, 1]) for name, own in found.items()}


def by_our_mcap_reader(path: Path) -> Read:
    return {name[len("/samples/") : -len(".value")]: own for name, own in _by_our_reader(path).items()}


def by_our_mf4_reader(path: Path) -> Read:
    return {name.rpartition("/")[2]: own for name, own in _by_our_reader(path).items()}


def _by_our_reader(path: Path) -> Read:
    log = open_log(path)
    (batch,) = log.batches()
    assert isinstance(batch, Rows)
    columns = {name: np.asarray(own, np.float64) for name, own in batch.columns.items()}
    return {name: (batch.t_ns[~np.isnan(own)] / 1e9, own[~np.isnan(own)]) for name, own in columns.items()}


def by_hand(path: Path) -> Read:
    """An MF4 from link to link, as ASAM's description of the blocks has them, by nothing of ours."""
    data = path.read_bytes()
    assert data.startswith(b"MDF     4.10")

    def block(at: int, mark: bytes) -> tuple[tuple[int, ...], bytes]:
        found, size, links = struct.unpack_from("<4s4xQQ", data, at)
        assert found == b"##" + mark
        return struct.unpack_from(f"<{links}Q", data, at + 24), data[at + 24 + 8 * links : at + size]

    def text(at: int) -> str:
        return block(at, b"TX")[1].split(b"\0")[0].decode()

    (data_group, *_), head = block(64, b"HD")
    (_, group, records, _), _ = block(data_group, b"DG")
    links, sizes = block(group, b"CG")
    count, width, marks = *struct.unpack_from("<Q", sizes, 8), *struct.unpack_from("<II", sizes, 24)
    rows = np.frombuffer(block(records, b"DT")[1], np.uint8).reshape(count, width + marks)
    found, channel = dict[str, tuple[Floats, Floats]](), links[1]
    t_s: Floats = np.empty(0)
    while channel:
        (channel, _, name, *_), says = block(channel, b"CN")
        kind, _, form, _, at, bits, flags, bit = struct.unpack_from("<BBBBIIII", says)
        assert (form, bits) == (4, 64)  # a number of 8 bytes
        values = rows[:, at : at + 8].copy().view("<f8")[:, 0]
        if kind == 2:  # the master: time
            t_s = struct.unpack_from("<Q", head)[0] / 1e9 + values
        else:
            there = (rows[:, width + bit // 8] >> bit % 8 & 1 if flags & 2 else np.zeros(count)) == 0
            found[text(name)] = t_s[there], values[there]
    return found


def by_asammdf(path: Path) -> Read:
    mdf = pytest.importorskip("asammdf").MDF(path)
    start_s = mdf.header.start_time.timestamp() if mdf.header.abs_time else 0.0
    signals = [mdf.get(name).validate() for name in mdf.channels_db if name != "t_s"]
    return {one.name: (start_s + one.timestamps, one.samples) for one in signals}


@pytest.mark.parametrize("session", ["can", "odd"])
@pytest.mark.parametrize(
    ("words", "read", "within_s"),
    [
        (("--to", "csv"), by_csv, 1e-6),
        (("--to", "csv", "--excel", "de"), by_german_excel, 1e-3),
        (("--to", "xlsx"), by_openpyxl, 1e-3),
        (("--to", "xlsx"), by_calamine, 1e-3),
        (("--to", "parquet"), by_duckdb, 1e-6),
        (("--to", "mcap"), by_rerun, 1e-6),
        (("--to", "mcap"), by_our_mcap_reader, 1e-6),
        (("--to", "mf4"), by_our_mf4_reader, 1e-6),
        (("--to", "mf4"), by_hand, 1e-6),
        (("--to", "mf4"), by_asammdf, 1e-6),
    ],
    ids=lambda one: one.__name__ if callable(one) else None,
)
def test_every_sample_is_read_again_at_its_time(
    folder: Path, tmp_path: Path, session: str, words: tuple[str, ...], read: Callable[[Path], Read], within_s: float
) -> None:
    path = exported(folder, tmp_path / f"out.{words[1]}", *words, session=session)
    found, true = read(path), recorded(folder, session)
    assert found.keys() == true.keys() and len(true) > 2
    for name, (t_s, value) in true.items():
        np.testing.assert_allclose(found[name][0], t_s, rtol=0, atol=within_s, err_msg=name)
        np.testing.assert_allclose(found[name][1], value, rtol=1e-9, err_msg=name)


def test_names_stand_with_their_units(folder: Path, tmp_path: Path) -> None:
    plain = exported(folder, tmp_path / "a.csv", "--to", "csv").read_text(encoding="utf-8").splitlines()
    assert plain[0].startswith("time_utc,t_s,MotorSpeed [rpm],MotorTorque [Nm],PhaseCurrent [A],TC_winding [degC]")
    assert plain[1].startswith("2025-10-09T08:53:20.000000Z,0,")
    parquet = exported(folder, tmp_path / "a.parquet", "--to", "parquet")
    assert ("session", "can") in ask(
        f"SELECT decode(key), decode(value) FROM parquet_kv_metadata('{parquet}')"
    ).fetchall()
    mcap = exported(folder, tmp_path / "a.mcap", "--to", "mcap")
    with mcap.open("rb") as file:
        channels = make_reader(file).get_summary().channels.values()  # type: ignore[union-attr]
    assert {one.topic: one.metadata["unit"] for one in channels}["/samples/TC_yoke"] == "degC"
    log = open_log(mcap)
    assert [*log.batches()] and log.units["/samples/TC_yoke.value"] == "degC"


@pytest.mark.parametrize(
    ("name", "unit", "title"),
    [
        ("n [1/min]", "rpm", "n [rpm]"),
        ("T (°C)", "degC", "T [degC]"),
        ("T [TC01]", "degC", "T [TC01] [degC]"),
        ("[K]", "degC", "[K] [degC]"),
        ("p [bar]", None, "p [bar]"),
    ],
)
def test_a_head_says_one_unit(name: str, unit: str | None, title: str) -> None:
    assert OutColumn(name, unit, "other", None).title == title


def test_heads_of_two_units_of_one_name_differ() -> None:
    columns = [OutColumn(name, "degC", "temperature", None) for name in ("T [K]", "T")]
    assert SessionRows("S", True, 0, columns, [], [], iter(())).titles == ("T [degC]", "T [degC]_2")


def test_a_spreadsheet_runs_no_name_as_a_formula(folder: Path, tmp_path: Path) -> None:
    for excel in ((), ("--excel", "de")):
        path = exported(folder, tmp_path / f"odd{len(excel)}.csv", "--to", "csv", *excel, session="odd")
        with path.open(encoding="utf-8-sig", newline="") as file:
            titles = next(csv.reader(file, delimiter=";" if excel else ","))
        assert titles == ["t_s", "'=1+1", "'-x;y", "T_Rücken"]
    book = load_workbook(exported(folder, tmp_path / "odd.xlsx", "--to", "xlsx", session="odd"))
    assert [(cell.value, cell.data_type) for cell in book.active[1]][1] == ("=1+1", "s")


def test_a_long_session_is_read_a_part_at_a_time(folder: Path) -> None:
    with Store.open(folder / "store") as store:
        facts = ledger_facts.at(store.ledger)
        whole, parts = (session_rows(store, facts, facts.session("can"), most) for most in (1_000_000, 400))
        (t_ns, values), some = next(whole.parts), list(parts.parts)
    assert whole.columns == parts.columns
    assert len(some) > 15 and max(len(t_ns) for t_ns, _ in some) < 60
    np.testing.assert_array_equal(np.concatenate([t for t, _ in some]), t_ns)
    np.testing.assert_array_equal(np.concatenate([v for _, v in some]), values)


def test_two_values_at_one_stamp_stand_in_two_rows() -> None:
    t_ns, values = samples._rows([(np.array([1, 1, 2]), np.array([5.0, 6.0, 7.0])), (np.array([1]), np.array([8.0]))])
    assert t_ns.tolist() == [1, 1, 2]
    np.testing.assert_array_equal(values, [[5, 8], [6, np.nan], [7, np.nan]])


def test_what_no_sheet_holds_goes_on_in_the_next(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(xlsx, "MOST_ROWS", 21)
    path = exported(folder, tmp_path / "odd.xlsx", "--to", "xlsx", session="odd")
    assert [len(list(sheet.iter_rows())) for sheet in load_workbook(path)] == [21, 21, 11]
    assert by_openpyxl(path)["-x;y"][1].tolist() == [float(-i) for i in range(50)]


def test_it_never_writes_over_a_file_and_leaves_no_part_of_one(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "a.mcap").write_text("mine")
    exported(folder, tmp_path / "a.mcap", "--to", "mcap", code=2)
    line = f"{tmp_path / 'a.mcap'}: is there already: give another name with -o, or remove it first.\n"
    assert capsys.readouterr().err == line
    exported(folder, tmp_path / "none" / "a.csv", "--to", "csv", code=2)
    assert f"there is no folder {tmp_path / 'none'}: make it first" in capsys.readouterr().err

    def full(path: Path, _: object) -> None:
        path.write_text("half")
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setitem(export.WRITERS, "mf4", full)
    exported(folder, tmp_path / "a.mf4", "--to", "mf4", code=2)
    assert "the disk is full" in capsys.readouterr().err
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {"a.mcap": "mine"}


def test_signals_that_the_bench_file_does_not_name_are_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "a.csv").write_text("t,n,T\n0,1500,20\n1,1501,21\n")
    (tmp_path / "b.csv").write_text("t,n,T\n0,1500,20\n1,1501,22\n")
    bench, store = tmp_path / "bench.toml", ["--store", str(tmp_path / "store")]
    bench.write_text('schema = "whyhot.bench/1"\n')
    assert main(["ingest", str(tmp_path / "a.csv"), "--bench", str(bench), *store]) == 0
    bench.write_text(bench.read_text() + '[[channel]]\nsignal = "n"\nquantity = "speed"\nunit = "rpm"\n')
    assert main(["ingest", str(tmp_path / "b.csv"), "--bench", str(bench), *store]) == 0
    for session, code, says in (
        ("a", 2, "session a: its bench file names none of its signals: there is nothing to export."),
        ("b", 0, "left out, as the bench file does not say what they are: T\n"),
    ):
        assert main(["export", session, "--to", "csv", "-o", str(tmp_path / f"{session}.out"), *store]) == code
        assert says in "".join(capsys.readouterr())


def test_columns_of_text_are_said_whether_the_bench_file_names_them_or_not(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "a.csv").write_text("t,n,mode,note\n0,1500,idle,a\n1,1501,run,b\n")
    channels = '[[channel]]\nsignal = "n"\nquantity = "speed"\nunit = "rpm"\n'
    channels += '[[channel]]\nsignal = "mode"\nquantity = "state"\nunit = "1"\nrole = "ignored"\n'
    bench, store = tmp_path / "bench.toml", ["--store", str(tmp_path / "store")]
    bench.write_text('schema = "whyhot.bench/1"\n' + channels)
    assert main(["ingest", str(tmp_path / "a.csv"), "--bench", str(bench), *store]) == 0
    capsys.readouterr()
    assert main(["export", "a", "--to", "csv", "-o", str(tmp_path / "out.csv"), *store]) == 0
    assert capsys.readouterr().out.endswith("1 channels\nleft out, as they hold text: mode, note\n")


def test_only_a_csv_is_for_the_excel_of_a_country(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["export", "can", "--to", "xlsx", "--excel", "de", "--store", str(folder / "store")])
    assert (
        "--excel is for --to csv: Excel reads numbers and dates of an xlsx file as they are" in capsys.readouterr().err
    )


@pytest.mark.parametrize("words", [("csv",), ("csv", "--excel", "de"), ("xlsx",), ("parquet",), ("mcap",), ("mf4",)])
def test_what_went_out_is_read_in_again_with_its_date_and_units(
    folder: Path, tmp_path: Path, words: tuple[str, ...]
) -> None:
    log = open_log(exported(folder, tmp_path / f"a.{words[0]}", "--to", *words))
    start_ns = min(int(batch.t_ns.min()) for batch in log.batches())
    assert log.absolute and start_ns == int(can_bench.START * 1e9)
    assert "degC" in log.units.values() and "rpm" in log.units.values()
