"""The shipped campaigns are what the plant writes."""

from __future__ import annotations

import gzip
import re
from pathlib import Path

import can
import pytest

from made.places import EXAMPLES
from plant import hidden_effect, insulation_example

SHIPPED = EXAMPLES / "hidden_effect"
MOST_CHANGED = 0.001  # of the frames: rounding in the last digit may differ between processors


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("hidden")
    hidden_effect.write(folder)
    return folder


def _frames(path: Path) -> list[tuple[float, object, int, bytes]]:
    with can.BLFReader(path) as reader:
        return [(m.timestamp, m.channel, m.arbitration_id, bytes(m.data)) for m in reader]


def test_the_plant_writes_the_shipped_logs_again(written: Path) -> None:
    names = sorted(path.name for path in SHIPPED.glob("*.blf"))
    assert names == sorted(path.name for path in written.glob("*.blf"))
    assert len(names) == 5
    for name in names:
        shipped, again = _frames(SHIPPED / name), _frames(written / name)
        assert len(shipped) == len(again)
        assert [frame[1:3] for frame in shipped] == [frame[1:3] for frame in again]
        assert [frame[0] for frame in shipped] == pytest.approx([frame[0] for frame in again], abs=1e-4, rel=0)
        changed = sum(a[3] != b[3] for a, b in zip(shipped, again, strict=True))
        assert changed <= MOST_CHANGED * len(shipped)


def test_the_shipped_logs_are_small_and_their_files_are_the_plants(written: Path) -> None:
    assert sum(path.stat().st_size for path in SHIPPED.glob("*.blf")) < 3_000_000
    for name in ("bench.toml", "bench.dbc"):
        assert (SHIPPED / name).read_text(encoding="utf-8") == (written / name).read_text(encoding="utf-8")


INSULATION = SHIPPED.parent / "insulation"
STEP = 0.11  # what a logger's last digit may be off by on another processor


def _numbers(path: Path) -> list[list[float]]:
    """The cells of a table that are decimal numbers, row by row."""
    rows = gzip.decompress(path.read_bytes()).decode("cp1252").split("\n")
    cells = [row.replace(",", ".").split(";") if ";" in row else row.split(",") for row in rows]
    return [[float(cell) for cell in row if re.fullmatch(r"-?\d+\.\d+", cell.strip())] for row in cells]


def test_the_plant_writes_the_shipped_stators_and_fleet_again(tmp_path: Path) -> None:
    insulation_example.write(tmp_path)
    names = sorted(path.relative_to(INSULATION).as_posix() for path in INSULATION.rglob("*.csv.gz"))
    assert names == sorted(path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*.csv.gz"))
    assert len(names) == 25
    for name in names:
        shipped, again = _numbers(INSULATION / name), _numbers(tmp_path / name)
        assert [len(row) for row in shipped] == [len(row) for row in again]
        assert sum(map(len, shipped)) > 400
        assert [x for row in shipped for x in row] == pytest.approx([x for row in again for x in row], abs=STEP)
    for path in INSULATION.rglob("*.toml"):
        assert path.read_text(encoding="utf-8") == (tmp_path / path.relative_to(INSULATION)).read_text(encoding="utf-8")


def test_the_shipped_stators_are_small() -> None:
    assert sum(path.stat().st_size for path in INSULATION.rglob("*.gz")) < 500_000
