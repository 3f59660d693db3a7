"""A boundary that no log holds: its temperature as a number in the bench file."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from ingest.bench.bench_file import read_bench
from ingest.errors import BenchFileError, TomlError
from made import can_bench
from replay.cli import main

MEASURED = '[[channel]]\nsignal = "TC_coolant"\nquantity = "temperature"\nunit = "degC"\nnode = "coolant"\n'
GIVEN = '[[channel]]\nvalue = {}\nquantity = "temperature"\nunit = "{}"\nnode = "{}"\n'


def mae_K(folder: Path, coolant: str, capsys: pytest.CaptureFixture[str]) -> dict[str, float]:
    """Mean errors of a replay under a bench file that says this of the coolant, which is at 30 degC."""
    folder.mkdir()
    can_bench.write_files(folder)
    assert MEASURED in can_bench.BENCH
    (folder / "bench.toml").write_text(can_bench.BENCH.replace(MEASURED, coolant), encoding="utf-8")
    can_bench.write_log(folder / "1_s1.blf", seconds=660)  # longer than an input may be silent
    words = ["ingest", str(folder / "1_s1.blf"), "--bench", str(folder / "bench.toml"), "--store", str(folder / "s")]
    assert main([*words, "--dbc", str(folder / "bench.dbc")]) == 0
    capsys.readouterr()
    assert main(["replay", "1_s1", "--json", "--store", str(folder / "s")]) == 0, capsys.readouterr().err
    (run,) = json.loads(capsys.readouterr().out)["runs"]
    assert main(["show", "1_s1", "--store", str(folder / "s")]) == 0
    return dict(run["mae_K"])


def test_a_value_stands_for_a_channel_that_measures_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    measured = mae_K(tmp_path / "measured", MEASURED, capsys)
    assert mae_K(tmp_path / "given", GIVEN.format(30, "degC", "coolant"), capsys) == pytest.approx(measured, abs=1e-4)
    assert mae_K(tmp_path / "other", GIVEN.format(122, "degF", "coolant"), capsys)["yoke"] > 1.0


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (GIVEN.format(23, "degC", "ambient") + 'level = "testing"\n', '"level" does not belong here'),
        (GIVEN.format(23, "rpm", "ambient").replace("temperature", "speed"), "no speed"),
        (GIVEN.format('"23"', "degC", "ambient"), "value"),
    ],
)
def test_what_is_no_value_of_a_boundary_is_refused(text: str, says: str) -> None:
    with pytest.raises((TomlError, BenchFileError), match=says):
        read_bench(('schema = "whyhot.bench/1"\n' + text).encode(), "bench.toml")


def test_a_value_of_a_node_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    can_bench.write_files(tmp_path)
    text = can_bench.BENCH + GIVEN.format(23, "degC", "magnet")
    (tmp_path / "bench.toml").write_text(text, encoding="utf-8")
    can_bench.write_log(tmp_path / "1_s1.blf", seconds=20)
    words = ["ingest", str(tmp_path / "1_s1.blf"), "--bench", str(tmp_path / "bench.toml")]
    assert main([*words, "--dbc", str(tmp_path / "bench.dbc"), "--store", str(tmp_path / "s")]) == 2
    assert 'node = "magnet" has a value, but is no boundary of the motor file' in capsys.readouterr().err
