"""Gradient-boosted trees over inputs and their exponentially weighted means.

The features are those with which W. Kirchgässner, O. Wallscheid and J. Böcker compare regressions of motor temperatures
(IEEE Trans. Energy Convers. 2021, DOI 10.1109/TEC.2021.3052546, arXiv 2001.06246); a mean with span T is also
what a lump of time constant T makes of a heat. How far the nodes began above the coolant decays with the same spans.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from benchmarks.real.recordings import Recording
from twin.motor.outputs import BLOCK_S

Floats = NDArray[np.float64]

SPANS_s = (60.0, 300.0, 1200.0, 3600.0)
RATE = 0.1  # of learning: scikit-learn's own
EVERY = 3  # block is learnt from: neighbours hardly differ


@dataclass(frozen=True)
class Size:
    """How large a model is."""

    leaves: int
    trees: int


SIZES = (Size(8, 100), Size(31, 100))


@dataclass(frozen=True)
class Boosted:
    """One model a node of how far its reading is above the coolant."""

    models: Mapping[str, Any]

    def rises(self, recording: Recording) -> dict[str, Floats]:
        """Node -> the rise over the coolant (B,) [K]."""
        given = features(recording)
        return {node: model.predict(given) for node, model in self.models.items()}


def learnt(recordings: Sequence[Recording], size: Size) -> Boosted:
    """A model of some recordings. Raises ImportError without scikit-learn."""
    from sklearn.ensemble import HistGradientBoostingRegressor

    models = {}
    given_of = {recording.name: features(recording) for recording in recordings}
    for node in recordings[0].readings:
        given = np.concatenate([given_of[one.name][one.blocks[node].there][::EVERY] for one in recordings])
        rises = np.concatenate([one.rises[node][::EVERY] for one in recordings])
        model = HistGradientBoostingRegressor(
            max_leaf_nodes=size.leaves, max_iter=size.trees, learning_rate=RATE, early_stopping=False, random_state=0
        )
        models[node] = model.fit(given, rises)
    return Boosted(models)


def features(recording: Recording) -> Floats:
    """Inputs, their means over the spans, and what is left of the start: (B, f)."""
    age_s = BLOCK_S * np.arange(len(recording.inputs), dtype=np.float64)[:, None]
    return np.column_stack([recording.inputs, *_spans(recording.inputs), *_decayed(recording.start, age_s)])


def _spans(inputs: Floats) -> Iterable[Floats]:
    """Exponentially weighted means, begun at the first value."""
    for span_s in SPANS_s:
        left = np.exp(-BLOCK_S / span_s)
        yield lfilter([1 - left], [1, -left], inputs, axis=0, zi=left * inputs[:1])[0]


def _decayed(start: Floats, age_s: Floats) -> Iterable[Floats]:
    for span_s in SPANS_s:
        yield start * np.exp(-age_s / span_s)
