"""Intake: files of one test join, late files regroup, the same bytes change nothing, and all can be made again."""

from __future__ import annotations

import shutil
from pathlib import Path

import can
import pytest

from ingest.catalogue.channels import load
from ingest.errors import DamageError
from ingest.facts import facts
from ingest.facts.facts import Facts
from ingest.facts.sessions import Override
from ingest.facts.store import Store
from ingest.intake.intake import Intake, take_in
from ingest.intake.making import redecode
from ingest.intake.setup import MotorFile, prepare
from made import can_bench
from made.lines_of_damage import damage

LOGGER = """\
schema = "whyhot.bench/1"
specimen = "servo-01"
[time]
column = "Time"
format = "%d.%m.%Y %H:%M:%S"
zone = "Europe/Rome"
[[channel]]
signal = "MotorSpeed"
quantity = "speed"
unit = "rpm"
[[channel]]
signal = "T_room"
quantity = "temperature"
unit = "degC"
node = "ambient"
"""


def _no_motor(path: Path) -> MotorFile:
    raise AssertionError(f"{path} should not be read")


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("logs")
    (folder / "bench.dbc").write_text(can_bench.DBC, encoding="utf-8")
    (folder / "bench.toml").write_text(LOGGER, encoding="utf-8")
    (folder / "can.toml").write_text(LOGGER[: LOGGER.rindex("[[channel]]")], encoding="utf-8")
    can_bench.write_log(folder / "5_drive.blf", seconds=60, start=can_bench.START)  # in local time, as the zone says
    rows = [f"09.10.2025 10:53:{25 + k};{21 + k / 10:.1f}".replace(".1;", ",1;") for k in range(30)]
    (folder / "5_room.csv").write_text("Time;T_room\n" + "\n".join(rows) + "\n", encoding="utf-8")
    return folder


def _take(folder: Path, logs: Path, *names: str, bench: str = "bench.toml", said: Override | None = None) -> Intake:
    paths = [logs / name for name in names]
    setup = prepare(paths, logs / bench, [logs / "bench.dbc"], _no_motor)
    with Store.open(folder, create=True, write=True) as store:
        return take_in(store, paths, setup, said or Override())


def _now(folder: Path) -> Facts:
    with Store.open(folder) as store:
        return facts.at(store.ledger)


def test_files_of_one_test_are_one_session(logs: Path, tmp_path: Path) -> None:
    _take(tmp_path / "s", logs, "5_drive.blf", "5_room.csv")
    (session,) = _now(tmp_path / "s").sessions
    assert session.name == "5_drive"
    assert len(session.files) == 2
    assert session.specimen == "servo-01"


def test_a_late_file_regroups_and_the_old_id_still_leads_there(logs: Path, tmp_path: Path) -> None:
    _take(tmp_path / "s", logs, "5_drive.blf", "5_room.csv")
    together = _now(tmp_path / "s").sessions[0].session
    _take(tmp_path / "u", logs, "5_drive.blf", bench="can.toml")
    alone = _now(tmp_path / "u").sessions[0].session
    _take(tmp_path / "u", logs, "5_drive.blf", "5_room.csv")
    known = _now(tmp_path / "u")
    assert [s.session for s in known.sessions] == [together]
    assert known.session(alone).session == together


def test_a_late_file_may_come_alone_with_the_same_bench_file(logs: Path, tmp_path: Path) -> None:
    _take(tmp_path / "s", logs, "5_drive.blf", "5_room.csv")
    shutil.copytree(logs, tmp_path / "more")
    text = (logs / "5_room.csv").read_text(encoding="utf-8").replace("10:53:", "10:54:")
    (tmp_path / "more" / "5_more.csv").write_text(text, encoding="utf-8")
    intake = _take(tmp_path / "s", tmp_path / "more", "5_more.csv")
    assert not intake.refusals
    (session,) = _now(tmp_path / "s").sessions
    assert len(session.files) == 3


def test_the_same_bytes_under_another_name_are_one_file(logs: Path, tmp_path: Path) -> None:
    _take(tmp_path / "s", logs, "5_drive.blf", bench="can.toml")
    shutil.copytree(logs, tmp_path / "copies")
    (tmp_path / "copies" / "copy.blf").write_bytes((logs / "5_drive.blf").read_bytes())
    intake = _take(tmp_path / "s", tmp_path / "copies", "copy.blf", bench="can.toml")
    assert intake.files[0].known
    assert len(_now(tmp_path / "s").files) == 1


def test_other_bytes_under_the_same_name_are_flagged(logs: Path, tmp_path: Path) -> None:
    _take(tmp_path / "s", logs, "5_drive.blf", bench="can.toml")
    shutil.copytree(logs, tmp_path / "other")
    can_bench.write_log(tmp_path / "other" / "5_drive.blf", seconds=60, seed=2, start=can_bench.START + 10_000)
    _take(tmp_path / "s", tmp_path / "other", "5_drive.blf", bench="can.toml")
    known = _now(tmp_path / "s")
    assert len(known.sessions) == 2
    assert [flag.flag for flags in known.flags.values() for flag in flags if flag.flag.startswith("same")] == [
        "same_name_other_bytes"
    ]


def test_what_is_said_on_the_command_line_beats_the_bench_file(logs: Path, tmp_path: Path) -> None:
    _take(
        tmp_path / "s", logs, "5_drive.blf", bench="can.toml", said=Override(specimen="servo-02", batch="B3", kind="s2")
    )
    (session,) = _now(tmp_path / "s").sessions
    assert (session.specimen, session.batch, session.kind) == ("servo-02", "B3", "s2")


def test_a_new_bench_version_is_no_new_session(logs: Path, tmp_path: Path) -> None:
    _take(tmp_path / "s", logs, "5_drive.blf", "5_room.csv")
    before = _now(tmp_path / "s").sessions[0]
    shutil.copytree(logs, tmp_path / "v2")
    bench = (logs / "bench.toml").read_text(encoding="utf-8")
    (tmp_path / "v2" / "bench.toml").write_text(bench + "noise = 0.2\n", encoding="utf-8")
    _take(tmp_path / "s", tmp_path / "v2", "5_drive.blf", "5_room.csv")
    (after,) = _now(tmp_path / "s").sessions
    assert after.session == before.session
    assert after.bench != before.bench


def test_products_are_made_again_from_sealed_bytes_alone(logs: Path, tmp_path: Path) -> None:
    _take(tmp_path / "s", logs, "5_drive.blf", "5_room.csv")
    products = {
        path.relative_to(tmp_path / "s"): path.read_bytes()
        for path in (tmp_path / "s" / "decoded").rglob("*")
        if path.is_file()
    }
    assert len(products) == 5
    shutil.rmtree(tmp_path / "s" / "decoded")
    (tmp_path / "s" / "decoded").mkdir()
    with Store.open(tmp_path / "s", write=True) as store:
        redecode(store, facts.at(store.ledger))
    for path, data in products.items():
        assert (tmp_path / "s" / path).read_bytes() == data, path


def test_the_archive_alone_explains_a_recording(logs: Path, tmp_path: Path) -> None:
    _take(tmp_path / "s", logs, "5_drive.blf", bench="can.toml")
    known = _now(tmp_path / "s")
    with Store.open(tmp_path / "s") as store:
        (raw,) = known.files
        assert store.archive.read(raw) == (logs / "5_drive.blf").read_bytes()
        (bench,) = known.benches
        assert store.archive.read(bench) == (logs / "can.toml").read_bytes()


def test_messages_are_found_by_29_bit_identifier_on_each_bus_and_in_two_databases(tmp_path: Path) -> None:
    extended = can_bench.DBC.replace("BO_ 256 Drive", f"BO_ {0x80000000 | 0x18FEF100} Drive")
    for name in ("a.dbc", "b.dbc"):
        (tmp_path / name).write_text(extended, encoding="utf-8")
    with can.Logger(str(tmp_path / "two.blf")) as log:
        for k in range(200):
            for bus in (0, 1):
                data = bytes([k, bus, 0, 0, 0, 0, 0, 0])
                log.on_message_received(
                    can.Message(can_bench.START + k / 10, 0x18FEF100, is_extended_id=True, data=data, channel=bus)
                )
    bench = LOGGER[: LOGGER.rindex("[[channel]]")].replace('"MotorSpeed"', '"can2:Drive.MotorSpeed"')
    (tmp_path / "bench.toml").write_text(bench, encoding="utf-8")
    paths = [tmp_path / "two.blf"]
    setup = prepare(paths, tmp_path / "bench.toml", [tmp_path / "a.dbc", tmp_path / "b.dbc"], _no_motor)
    with Store.open(tmp_path / "s", create=True, write=True) as store:
        assert not take_in(store, paths, setup, Override()).refusals
        known = facts.at(store.ledger)
        (speed,) = [c for c in load(store, known, known.sessions[0]) if c.spec.quantity == "speed"]
    assert speed.value[:3].tolist() == [256.0, 257.0, 258.0]


def test_a_cut_copy_joins_is_flagged_and_adds_no_sample(logs: Path, tmp_path: Path) -> None:
    _take(tmp_path / "s", logs, "5_drive.blf", bench="can.toml")
    shutil.copytree(logs, tmp_path / "cut")
    can_bench.write_log(tmp_path / "cut" / "0_copy.blf", seconds=30, start=can_bench.START)
    _take(tmp_path / "s", tmp_path / "cut", "0_copy.blf", bench="can.toml")
    with Store.open(tmp_path / "s") as store:
        known = facts.at(store.ledger)
        (session,) = known.sessions
        (speed,) = [c for c in load(store, known, session) if c.spec.quantity == "speed"]
    assert session.name == "5_drive", "the longer file names the session"
    assert known.session("5_drive").session == session.session
    assert len(speed.t_ns) == 600, "equal samples of two files count once"
    assert "overlap" in {flag.flag for flags in known.flags.values() for flag in flags}


def test_the_same_bytes_twice_in_one_command_are_one_file(logs: Path, tmp_path: Path) -> None:
    shutil.copytree(logs, tmp_path / "in")
    shutil.copy(logs / "5_drive.blf", tmp_path / "in" / "copy.blf")
    intake = _take(tmp_path / "s", tmp_path / "in", "5_drive.blf", "5_drive.blf", "copy.blf", bench="can.toml")
    assert [one.known for one in intake.files] == [False, True, True]
    assert all(one.decode for one in intake.files)
    assert len(_now(tmp_path / "s").files) == 1


def test_rebuilding_and_late_files_work_with_signals_named_in_full(logs: Path, tmp_path: Path) -> None:
    shutil.copytree(logs, tmp_path / "in")
    full = LOGGER.replace('"MotorSpeed"', '"can1:Drive.MotorSpeed"') + (
        '[[derived]]\nname = "power"\nquantity = "power"\nunit = "W"\n'
        'expression = "`Drive.MotorTorque` * MotorSpeed * 0.10472"\n'
    )
    (tmp_path / "in" / "bench.toml").write_text(full, encoding="utf-8")
    _take(tmp_path / "s", tmp_path / "in", "5_drive.blf", "5_room.csv")
    text = (logs / "5_room.csv").read_text(encoding="utf-8").replace("10:53:", "10:54:")
    (tmp_path / "in" / "5_more.csv").write_text(text, encoding="utf-8")
    assert not _take(tmp_path / "s", tmp_path / "in", "5_more.csv").refusals
    products = {p: p.read_bytes() for p in (tmp_path / "s" / "decoded").rglob("*.parquet")}
    with Store.open(tmp_path / "s", write=True) as store:
        redecode(store, facts.at(store.ledger))
    assert {p: p.read_bytes() for p in (tmp_path / "s" / "decoded").rglob("*.parquet")} == products


def test_damaged_sealed_bytes_are_not_decoded_again(logs: Path, tmp_path: Path) -> None:
    _take(tmp_path / "s", logs, "5_drive.blf", bench="can.toml")
    (raw,) = _now(tmp_path / "s").files
    blob = tmp_path / "s" / "archive" / raw[:2] / raw
    blob.chmod(0o644)
    blob.write_bytes(blob.read_bytes()[:-100] + bytes(100))
    products = {p: p.read_bytes() for p in (tmp_path / "s" / "decoded").rglob("*") if p.is_file()}
    with Store.open(tmp_path / "s", write=True) as store, pytest.raises(DamageError, match=r"5_drive\.blf"):
        redecode(store, facts.at(store.ledger))
    assert {p: p.read_bytes() for p in products} == products


def test_ingesting_the_original_again_mends_a_damaged_or_lost_blob(logs: Path, tmp_path: Path) -> None:
    _take(tmp_path / "s", logs, "5_drive.blf", bench="can.toml")
    (raw,) = _now(tmp_path / "s").files
    blob = tmp_path / "s" / "archive" / raw[:2] / raw
    for left in (b"x", None):
        blob.unlink()
        if left:
            blob.write_bytes(left)
        assert _take(tmp_path / "s", logs, "5_drive.blf", bench="can.toml").files[0].known
        with Store.open(tmp_path / "s") as store:
            assert damage(store) == []


def test_what_explains_a_log_is_mended_too_when_it_is_given_again(logs: Path, tmp_path: Path) -> None:
    _take(tmp_path / "s", logs, "5_drive.blf", bench="can.toml")
    known = _now(tmp_path / "s")
    for sha in (*known.databases, *known.benches):
        blob = tmp_path / "s" / "archive" / sha[:2] / sha
        blob.unlink()
        blob.write_bytes(b"x")
    assert _take(tmp_path / "s", logs, "5_drive.blf", bench="can.toml").files[0].known
    with Store.open(tmp_path / "s") as store:
        assert damage(store) == []


def test_a_known_file_says_whether_its_session_is_another_now(logs: Path, tmp_path: Path) -> None:
    _take(tmp_path / "s", logs, "5_drive.blf", bench="can.toml")
    (same,) = _take(tmp_path / "s", logs, "5_drive.blf", bench="can.toml").files
    (other,) = _take(tmp_path / "s", logs, "5_drive.blf", bench="can.toml", said=Override(specimen="servo-09")).files
    assert (same.known, same.anew, other.known, other.anew) == (True, False, True, True)


def test_a_table_is_the_same_with_and_without_a_database(logs: Path, tmp_path: Path) -> None:
    _take(tmp_path / "s", logs, "5_drive.blf", "5_room.csv")
    paths = [logs / "5_room.csv"]
    setup = prepare(paths, logs / "bench.toml", [], _no_motor)
    with Store.open(tmp_path / "s", write=True) as store:
        assert take_in(store, paths, setup, Override()).files[0].known


def test_tables_of_one_test_with_other_columns_do_not_overlap(logs: Path, tmp_path: Path) -> None:
    shutil.copytree(logs, tmp_path / "in")
    text = (logs / "5_room.csv").read_text(encoding="utf-8").replace("T_room", "MotorSpeed")
    (tmp_path / "in" / "5_speed.csv").write_text(text, encoding="utf-8")
    _take(tmp_path / "s", tmp_path / "in", "5_speed.csv", "5_room.csv")
    known = _now(tmp_path / "s")
    assert len(known.sessions) == 1
    assert "overlap" not in {flag.flag for flags in known.flags.values() for flag in flags}
