"""Bad input: one clear line each (what, where, why, what to do), the right exit code, and a store that is whole."""

from __future__ import annotations

import errno
import json
import os
import struct
from pathlib import Path

import pytest

from ingest.facts.store import Store
from made import can_bench
from made.lines_of_damage import damage
from replay.cli import main

Capture = pytest.CaptureFixture[str]


@pytest.fixture(scope="module")
def whole_log(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("log") / "1_s1.blf"
    can_bench.write_log(path, seconds=300)  # two containers
    return path.read_bytes()


@pytest.fixture
def bench(tmp_path: Path, whole_log: bytes, monkeypatch: pytest.MonkeyPatch) -> Path:
    can_bench.write_files(tmp_path)
    (tmp_path / "1_s1.blf").write_bytes(whole_log)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def _refused(capsys: Capture, code: int, *words: str) -> str:
    """The one line that a command refuses with."""
    capsys.readouterr()
    assert main(list(words)) == code
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1, lines
    return lines[0]


def _ingest(capsys: Capture, code: int, log: str = "1_s1.blf") -> str:
    return _refused(capsys, code, "ingest", log, "--bench", "bench.toml", "--dbc", "bench.dbc")


def _is_whole() -> bool:
    with Store.open(Path("whyhot-store")) as store:
        return damage(store) == []


def _frames() -> dict[str, int]:
    with Store.open(Path("whyhot-store")) as store:
        from ingest.facts import facts

        (decode,) = facts.at(store.ledger).decodes.values()
        return decode.balance


def _edit(path: str, old: str, new: str) -> None:
    text = Path(path).read_text(encoding="utf-8")
    assert old in text
    Path(path).write_text(text.replace(old, new, 1), encoding="utf-8")


def test_frames_without_a_database_are_kept_undecoded(bench: Path, capsys: Capture) -> None:
    line = _refused(capsys, 1, "ingest", "1_s1.blf")
    assert "1_s1.blf" in line
    assert "--dbc" in line
    assert _frames() == {"found": 3300, "decoded": 0, "unknown_id": 3300, "wrong_length": 0, "rejected": 0}
    assert _is_whole()


def test_a_database_that_is_not_there_is_named(bench: Path, capsys: Capture) -> None:
    line = _refused(capsys, 2, "ingest", "1_s1.blf", "--dbc", "nowhere.dbc")
    assert "nowhere.dbc" in line
    assert not Path("whyhot-store").exists()


def test_a_cut_log_keeps_what_could_be_read(bench: Path, capsys: Capture, whole_log: bytes) -> None:
    Path("1_s1.blf").write_bytes(whole_log[: len(whole_log) * 2 // 3])
    line = _ingest(capsys, 1)
    assert "1_s1.blf" in line
    assert "byte" in line
    balance = _frames()
    assert balance["found"] == balance["decoded"] + balance["rejected"]
    assert _is_whole()


@pytest.mark.parametrize("size", [0, 0xFFFFFFFF])
def test_an_object_of_an_impossible_size_stops_nothing(
    bench: Path, capsys: Capture, whole_log: bytes, size: int
) -> None:
    second = whole_log.index(b"LOBJ", whole_log.index(b"LOBJ") + 4)
    Path("1_s1.blf").write_bytes(whole_log[: second + 8] + struct.pack("<I", size) + whole_log[second + 12 :])
    line = _ingest(capsys, 1)
    assert "1_s1.blf" in line
    assert "byte" in line
    assert _is_whole()


def test_an_empty_file_is_refused(bench: Path, capsys: Capture) -> None:
    Path("empty.blf").touch()
    line = _ingest(capsys, 1, "empty.blf")
    assert "empty.blf" in line
    assert "empty" in line


def test_a_file_that_is_not_there_is_named(bench: Path, capsys: Capture) -> None:
    assert "2_s2.blf" in _ingest(capsys, 2, "2_s2.blf")


def test_text_in_a_number_column_is_set_aside_with_its_line(bench: Path, capsys: Capture) -> None:
    rows = [f"{k},{25 + k / 100:.2f},{1000 + k}" for k in range(50)]
    rows[20] = "20,broken,1020"
    Path("tc.csv").write_text("time,T_winding,speed\n" + "\n".join(rows) + "\n", encoding="utf-8")
    line = _refused(capsys, 1, "ingest", "tc.csv")
    assert "tc.csv" in line
    assert "line 22" in line
    assert "T_winding" in line
    balance = _frames()
    assert (balance["found"], balance["decoded"], balance["rejected"]) == (50, 49, 1)
    assert _is_whole()


def test_decimal_commas_between_commas_are_recognised(bench: Path, capsys: Capture) -> None:
    rows = "\n".join(f"{k},25,{k % 100},1000,5" for k in range(50))
    Path("tc.csv").write_text("time,T_winding,speed\n" + rows + "\n", encoding="utf-8")
    line = _refused(capsys, 1, "ingest", "tc.csv")
    assert "tc.csv" in line
    assert "decimal" in line
    assert _is_whole()


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        ('signal = "TC_magnet"', 'signal = "TC_Magnet"', ("bench.toml:", "TC_Magnet", "TC_magnet")),
        ('unit = "rpm"', 'unit = "Nm"', ("bench.toml:", "Nm", "speed")),
        ('node = "magnet"', 'node = "magnets"', ("bench.toml:", "magnets", "magnet")),
        ('quantity = "torque"', 'quantity = "torqe"', ("bench.toml:", "torqe", "torque")),
        ('specimen = "servo-01"', 'speciman = "servo-01"', ("bench.toml:", "speciman", "specimen")),
        ('motor = "motor.toml"', 'motor = "other.toml"', ("bench.toml", "other.toml")),
        ("[[channel]]", "[[channel]", ("bench.toml:",)),
    ],
)
def test_a_bench_file_is_refused_before_anything_is_kept(
    bench: Path, capsys: Capture, old: str, new: str, named: tuple[str, ...]
) -> None:
    _edit("bench.toml", old, new)
    line = _ingest(capsys, 2)
    for word in named:
        assert word in line, line
    assert not Path("whyhot-store").exists()


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        ("capacity = 900.0", "capacity = -900.0", ("motor.toml:", "winding", "capacity")),
        (
            '[[link]]\nbetween = ["yoke", "magnet"]\nterms = [{coefficient = 1.0}, {coefficient = 2.0, speed = 0.8}]\n',
            "",
            ("motor.toml:", "magnet", "boundary"),
        ),
        ('between = ["winding", "yoke"]', 'between = ["winding", "yok"]', ("motor.toml:", "yok", "yoke")),
        ("speed = 1.5", "sped = 1.5", ("motor.toml:", "sped", "speed")),
    ],
)
def test_a_motor_file_is_refused_with_its_entry(
    bench: Path, capsys: Capture, old: str, new: str, named: tuple[str, ...]
) -> None:
    _edit("motor.toml", old, new)
    for line in (_ingest(capsys, 2), _refused(capsys, 2, "motor", "check", "motor.toml")):
        for word in named:
            assert word in line, line


@pytest.mark.parametrize("room", [2, 5, 8, 11, 14])
def test_a_full_disk_stops_with_one_line_and_a_whole_store(
    bench: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch, room: int
) -> None:
    real, calls = os.fsync, 0

    def full(descriptor: int) -> None:
        nonlocal calls
        calls += 1
        if calls > room:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "whyhot-store/archive")
        real(descriptor)

    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", full)
        line = _ingest(capsys, 2)
    assert "disk" in line or "space" in line
    assert not Path("whyhot-store").exists() or _is_whole()
    capsys.readouterr()
    assert main(["ingest", "1_s1.blf", "--bench", "bench.toml", "--dbc", "bench.dbc"]) == 0, (
        "after space was made it goes on"
    )
    assert _is_whole()


def test_a_session_without_a_needed_input_says_which(bench: Path, capsys: Capture) -> None:
    _edit("bench.toml", 'signal = "PhaseCurrent"\n', 'signal = "PhaseCurrent"\nrole = "ignored"\n')
    assert main(["ingest", "1_s1.blf", "--bench", "bench.toml", "--dbc", "bench.dbc"]) == 0
    line = _refused(capsys, 2, "replay", "1_s1")
    assert "current" in line
    assert "1_s1" in line


def test_the_json_of_a_refusal_carries_the_line(bench: Path, capsys: Capture) -> None:
    _edit("bench.toml", 'node = "magnet"', 'node = "magnets"')
    words = ["ingest", "1_s1.blf", "--bench", "bench.toml", "--dbc", "bench.dbc", "--json"]
    assert main(words) == 2
    assert "magnets" in json.loads(capsys.readouterr().out)["error"]


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        ('name = "magnet"', 'name = "rotor"', ("TC_magnet", "magnet", "servo-5kW")),
        ("coefficient = 240.0, current", "coefficient = 2.4e9, current", ("winding", "2,000 degC")),
    ],
)
def test_a_model_that_does_not_fit_the_session_is_refused(
    bench: Path, capsys: Capture, old: str, new: str, named: tuple[str, ...]
) -> None:
    assert main(["ingest", "1_s1.blf", "--bench", "bench.toml", "--dbc", "bench.dbc"]) == 0
    text = Path("motor.toml").read_text(encoding="utf-8")
    text = text.replace(old, new).replace('"magnet"', '"rotor"') if "rotor" in new else text.replace(old, new)
    Path("other.toml").write_text(text, encoding="utf-8")
    line = _refused(capsys, 2, "replay", "1_s1", "--model", "other.toml")
    for word in named:
        assert word in line, line


def test_a_boundary_that_is_called_observed_stays_a_boundary(bench: Path, capsys: Capture) -> None:
    _edit("bench.toml", 'node = "coolant"', 'node = "coolant"\nrole = "observed"')
    assert main(["ingest", "1_s1.blf", "--bench", "bench.toml", "--dbc", "bench.dbc"]) == 0
    capsys.readouterr()
    assert main(["replay", "1_s1", "--json"]) == 0
    assert set(json.loads(capsys.readouterr().out)["runs"][0]["mae_K"]) == {"winding", "yoke", "magnet"}


def test_a_bench_file_for_frames_needs_a_database(bench: Path, capsys: Capture) -> None:
    line = _refused(capsys, 2, "ingest", "1_s1.blf", "--bench", "bench.toml")
    assert "bench.toml" in line
    assert "--dbc" in line
    assert not Path("whyhot-store").exists()


@pytest.mark.parametrize("word", ["--as-of=--", "--store=--", "--json=--"])
def test_an_option_without_its_value_is_one_line(capsys: Capture, word: str) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["sessions", word])
    (line,) = capsys.readouterr().err.splitlines()
    assert ended.value.code == 2 and line.startswith(f"whyhot: argument {word[:-3]}: expected one argument")
