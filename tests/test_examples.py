"""The shipped campaign is what its plant writes."""

from __future__ import annotations

from pathlib import Path

import can
import pytest

from plant import hidden_effect

SHIPPED = Path(__file__).parents[1] / "examples" / "hidden_effect"
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
