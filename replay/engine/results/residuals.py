"""What the model gets wrong: size, sign and place of the residuals, against what the channel itself can tell."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from replay.engine.results.run import Metered, Observed

Floats = NDArray[np.float64]

CELLS = 8
CONCENTRATED = 1.25  # a cell belongs to "where" if its mean error is this much above the whole's


def channel_summary(observed: Observed, places: Mapping[str, Floats], start_ns: int) -> dict[str, Any] | None:
    """One entry of `channels` of a run's summary; None where nothing of the channel could be used.

    `places`: name with unit -> (M,) values at the observed steps, in which the error is located.
    """
    use = observed.used & np.isfinite(observed.residual)
    if not use.any():
        return None
    residual, size = observed.residual[use], np.abs(observed.residual[use])
    worst = int(np.argmax(size))
    return {
        "channel": observed.channel,
        "node": observed.node,
        "mae_K": float(size.mean()),
        "max_K": float(size[worst]),
        "bias_K": float(residual.mean()),
        "white_K": observed.sd_K,
        "bias_sd_K": observed.bias_sd_K,
        "floor_K": float(np.hypot(observed.sd_K, observed.bias_sd_K)),
        "samples": int(use.sum()),
        "masked": int((~observed.used).sum()),
        "max_at_s": float((observed.t_ns[use][worst] - start_ns) / 1e9),
        "where": {name: span for name, at in places.items() if (span := where(at[use], size)) is not None},
    }


def meter_summary(metered: Metered, places: Mapping[str, Floats], start_ns: int) -> dict[str, Any] | None:
    """One entry of `meters` of a run's summary, numbers in `unit`; None where nothing of the channel could be used."""
    use = metered.used & np.isfinite(metered.residual)
    if not use.any():
        return None
    residual, size = metered.residual[use], np.abs(metered.residual[use])
    worst = int(np.argmax(size))
    return {
        "channel": metered.channel,
        "quantity": metered.quantity,
        "place": metered.place,
        "unit": metered.unit,
        "mae": float(size.mean()),
        "max": float(size[worst]),
        "bias": float(residual.mean()),
        "mean": float(metered.measured[use].mean()),
        "white": metered.sd,
        "bias_sd": metered.bias_sd,
        "gain_sd": metered.gain_sd,
        "floor": metered.floor,
        "samples": int(use.sum()),
        "masked": int((~metered.used).sum()),
        "max_at_s": float((metered.t_ns[use][worst] - start_ns) / 1e9),
        "where": {name: span for name, at in places.items() if (span := where(at[use], size)) is not None},
    }


def where(place: Floats, size: Floats) -> list[float] | None:
    """The range of `place` in which the error concentrates, or None where it is spread evenly.

    The range of `place` is cut into 8 equal cells; the answer is the contiguous run of cells with a
    mean error 25 % above the whole's that holds most of it, if it holds at least half of the error in at most 60 % of the time.
    """
    finite = np.isfinite(place)
    place, size = place[finite], size[finite]
    if place.size < 20:
        return None
    low, high = float(place.min()), float(place.max())
    if high - low < 1e-9 * max(1.0, abs(high)):
        return None
    edges = np.linspace(low, high, CELLS + 1)
    cell = np.clip(np.searchsorted(edges, place, side="right") - 1, 0, CELLS - 1)
    count, total = np.bincount(cell, minlength=CELLS), np.bincount(cell, size, minlength=CELLS)
    above = total > CONCENTRATED * size.mean() * count
    best = max(_runs(above), key=lambda run: total[run[0] : run[1]].sum(), default=None)
    if best is None:
        return None
    a, b = best
    if total[a:b].sum() < 0.5 * size.sum() or count[a:b].sum() > 0.6 * place.size:
        return None
    return [float(edges[a]), float(edges[b])]


def _runs(flag: NDArray[np.bool_]) -> list[tuple[int, int]]:
    padded = np.concatenate([[False], flag, [False]]).astype(np.int8)
    change = np.diff(padded)
    return list(zip(np.flatnonzero(change == 1).tolist(), np.flatnonzero(change == -1).tolist(), strict=True))


def by_node(channels: list[dict[str, Any]], key: str) -> dict[str, float]:
    """Channels of one node together: mean by samples of `mae_K` and `bias_K`, largest of `max_K`."""
    nodes: dict[str, float] = {}
    for node in dict.fromkeys(c["node"] for c in channels):
        mine = [c for c in channels if c["node"] == node]
        values, weights = [c[key] for c in mine], [c["samples"] for c in mine]
        nodes[node] = max(values) if key == "max_K" else float(np.average(values, weights=weights))
    return nodes
