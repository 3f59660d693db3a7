"""How far off a way of saying temperatures is, over all of a recording, and inside and outside the trained points."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.real.recordings import Recording
from replay.studies.diagnosis.kept_sessions import outside_trained

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True)
class Errors:
    """Mean absolute errors [K]: node -> over the whole recording (`mae`), and the mean over the nodes in those blocks
    of 10 s that lie inside and outside the trained points, None where there are none."""

    mae: dict[str, float]
    inside: float | None
    outside: float | None


def errors(residual: Mapping[str, Floats], outside: Mapping[str, Bools]) -> Errors:
    """Of residuals by node [K], and which of their blocks lie outside."""
    mae = {node: float(np.abs(missed).mean()) for node, missed in residual.items()}
    return Errors(mae, _where(residual, {n: ~o for n, o in outside.items()}), _where(residual, outside))


def _where(residual: Mapping[str, Floats], there: Mapping[str, Bools]) -> float | None:
    if not all(blocks.any() for blocks in there.values()):
        return None
    return float(np.mean([np.abs(residual[node][blocks]).mean() for node, blocks in there.items()]))


def outside(recording: Recording, learnt: Sequence[Recording]) -> dict[str, Bools]:
    """Node -> the blocks that were driven, for most of their time, at a speed and current that were not learnt from."""
    (steps,) = outside_trained([one.test for one in learnt], [recording.test])
    return {node: blocks.of_steps(steps.astype(np.float64)) > 0.5 for node, blocks in recording.blocks.items()}
