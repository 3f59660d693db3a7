"""One drive in every format of frames: inspected and ingested with one bench file and one DBC, equal to the BLF."""

import json
from pathlib import Path

import pytest

from made import can_bench
from replay.cli import main

Capture = pytest.CaptureFixture[str]


def samples(log: Path, capsys: Capture) -> list[list[float]]:
    """Quantity, seconds since the log began, and value of every sample in a store of its own."""
    folder = log.parent
    store = ["--store", str(folder / f"store{log.suffix}")]
    words = ["--bench", str(folder / "bench.toml"), "--dbc", str(folder / "bench.dbc")]
    assert main(["inspect", str(log), "--dbc", str(folder / "bench.dbc")]) == 0
    assert "660 frames in " in capsys.readouterr().out
    assert main(["ingest", str(log), *words, *store]) == 0, capsys.readouterr().err
    capsys.readouterr()
    query = (
        "SELECT quantity, node, round((t_ns - min(t_ns) OVER ()) / 1e6) AS ms, value FROM samples "
        "WHERE quantity IS NOT NULL ORDER BY ALL"
    )
    assert main(["sql", query, "--json", *store]) == 0
    return [list(row.values()) for row in json.loads(capsys.readouterr().out)["rows"]]


@pytest.mark.parametrize("suffix", [".asc", ".trc", ".log", ".csv"])
def test_a_drive_gives_the_same_samples_in_every_format(suffix: str, tmp_path: Path, capsys: Capture) -> None:
    can_bench.write_files(tmp_path)
    found = {}
    for one in (".blf", suffix):
        log = tmp_path / f"drive{one}"
        assert can_bench.write_log(log, seconds=60) == 660
        found[one] = samples(log, capsys)
    assert len(found[".blf"]) == 3 * 600 + 4 * 60
    assert found[suffix] == found[".blf"]
