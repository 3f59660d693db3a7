"""Stamps looked through from files where they are many: the same is found, and memory hardly grows."""

from __future__ import annotations

import tracemalloc
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from ingest.formats import Frames
from ingest.log import recording, spill
from ingest.log.stamps import look

DAY_NS = 86_400 * 1_000_000_000


def frames(t_ns: NDArray[np.int64], can_id: NDArray[np.uint32], value: NDArray[np.uint8]) -> Frames:
    """Frames of one byte each on bus 1."""
    count = len(t_ns)
    one, zero = np.ones(count, np.uint8), np.zeros(count, np.uint8)
    return Frames(t_ns, one, can_id, zero, np.arange(count + 1), value, np.arange(count))


def piece(whole: Frames, a: int, b: int) -> Frames:
    names = ("t_ns", "bus", "can_id", "flags", "record")
    t_ns, bus, can_id, flags, record = (getattr(whole, name)[a:b] for name in names)
    return Frames(t_ns, bus, can_id, flags, whole.offsets[a : b + 1], whole.data, record)


def odd_log(seed: int) -> Frames:
    """A few hundred frames of three identifiers; stamps are equal, go back, jump, stand there twice or far off."""
    random = np.random.default_rng(seed)
    t_ns = np.cumsum(random.integers(0, 3, int(random.integers(40, 400)))) * 250_000_000
    half = len(t_ns) // 2
    t_ns[half:] += int(random.choice([0, -DAY_NS, 9 * DAY_NS]))
    t_ns = np.concatenate([t_ns, t_ns[half // 2 : half]]) if seed % 2 else t_ns
    t_ns[random.integers(0, len(t_ns), seed % 3)] += 900 * DAY_NS
    count = len(t_ns)
    return frames(
        t_ns, random.choice([1, 2, 3], count).astype(np.uint32), random.integers(0, 2, count).astype(np.uint8)
    )


@pytest.mark.parametrize("seed", range(24))
def test_what_is_found_does_not_depend_on_what_memory_holds(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, seed: int
) -> None:
    log = odd_log(seed)
    parts = [("raw/can1", piece(log, a, min(a + 37, len(log.t_ns)))) for a in range(0, len(log.t_ns), 37)]
    monkeypatch.setattr(recording, "read", lambda _: iter(parts))
    whole = look(tmp_path / "recording.mcap")
    monkeypatch.setattr(spill, "MOST_ROWS", 11)
    spilt = look(tmp_path / "recording.mcap")
    assert {**vars(spilt), "strays": spilt.strays.tolist()} == {**vars(whole), "strays": whole.strays.tolist()}
    assert whole.counted()
    assert list(tmp_path.iterdir()) == []


TWICE, SAME, BACKWARDS = "written twice", "one stamp", "backwards"


@pytest.mark.parametrize("kind", [TWICE, SAME, BACKWARDS])
def test_memory_hardly_grows_with_the_records(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str) -> None:
    def read(_: Path) -> Iterator[tuple[str, Frames]]:
        for first in range(0, count, 20_000):
            number = np.arange(first, first + 20_000)
            step = {TWICE: number % (count // 2), SAME: number * 0, BACKWARDS: 2 * (count - number) * (number > 0)}[
                kind
            ]
            yield "raw/can1", frames(step * 1_000_000, np.full(20_000, 7, np.uint32), np.zeros(20_000, np.uint8))

    monkeypatch.setattr(recording, "read", read)
    monkeypatch.setattr(spill, "MOST_ROWS", 20_000)
    peaks = []
    for count in (100_000, 400_000):
        tracemalloc.start()
        found = look(tmp_path / "recording.mcap")
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        counts = (found.block_records, found.equal, found.back_steps)
        assert counts == {TWICE: (count // 2, 0, 0), SAME: (0, count - 1, 0), BACKWARDS: (0, 0, count - 2)}[kind]
    assert (peaks[1] - peaks[0]) / 300_000 < 1, f"bytes a record, at peaks of {peaks}"
