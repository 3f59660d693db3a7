"""What the model gets wrong: size, sign and place of the residuals, against what the channel itself can tell."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from replay.engine.frame.frame import InputFrame
from replay.engine.results.artefacts import AROUND, steps_of
from replay.engine.results.run import Compared, Metered, Observed
from replay.engine.results.summary import ChannelErrors, MeterErrors

Floats = NDArray[np.float64]

CELLS = 8
CONCENTRATED = 1.25  # a cell belongs to "where" if its mean error is this much above the whole's


def errors_of_channels(frame: InputFrame, observed: Sequence[Observed]) -> list[ChannelErrors]:
    """The errors of a run's thermometers; one without a usable step is left out."""
    start = int(frame.t_ns[0])
    places = ({**_around(frame, o), "temperature_degC": o.measured, "t_s": _seconds(o, start)} for o in observed)
    found = (channel_errors(o, around, start) for o, around in zip(observed, places, strict=True))
    return [one for one in found if one is not None]


def errors_of_meters(frame: InputFrame, meters: Sequence[Metered]) -> list[MeterErrors]:
    """The errors of a run's other meters; one without a usable step is left out."""
    start = int(frame.t_ns[0])
    found = (meter_errors(m, {**_around(frame, m), "t_s": _seconds(m, start)}, start) for m in meters)
    return [one for one in found if one is not None]


def channel_errors(observed: Observed, places: Mapping[str, Floats], start_ns: int) -> ChannelErrors | None:
    """The errors of a thermometer over its usable steps; None where it has none.

    `places`: name with unit -> values (M,) at the observed steps, in which the error is located.
    """
    use = observed.used & np.isfinite(observed.residual)
    if not use.any():
        return None
    size = np.abs(observed.residual[use])
    worst = int(np.argmax(size))
    return ChannelErrors(
        channel=observed.channel,
        node=observed.node,
        mae_K=float(size.mean()),
        max_K=float(size[worst]),
        bias_K=float(observed.residual[use].mean()),
        white_K=observed.sd_K,
        bias_sd_K=observed.bias_sd_K,
        floor_K=float(np.hypot(observed.sd_K, observed.bias_sd_K)),
        samples=int(use.sum()),
        masked=int((~observed.used).sum()),
        max_at_s=float(_seconds(observed, start_ns)[use][worst]),
        where=_where(places, use, size),
    )


def meter_errors(metered: Metered, places: Mapping[str, Floats], start_ns: int) -> MeterErrors | None:
    """The errors of a meter that is no thermometer, in its own unit; all else as `channel_errors`."""
    use = metered.used & np.isfinite(metered.residual)
    if not use.any():
        return None
    size = np.abs(metered.residual[use])
    worst = int(np.argmax(size))
    return MeterErrors(
        channel=metered.channel,
        quantity=metered.quantity,
        place=metered.place,
        unit=metered.unit,
        mae=float(size.mean()),
        max=float(size[worst]),
        bias=float(metered.residual[use].mean()),
        mean=float(metered.measured[use].mean()),
        white=metered.sd,
        bias_sd=metered.bias_sd,
        gain_sd=metered.gain_sd,
        floor=metered.floor,
        samples=int(use.sum()),
        masked=int((~metered.used).sum()),
        max_at_s=float(_seconds(metered, start_ns)[use][worst]),
        where=_where(places, use, size),
    )


def _around(frame: InputFrame, o: Compared) -> dict[str, Floats]:
    """The inputs that an error may go with, at the steps of a channel (M,)."""
    return {name: frame.inputs[name][steps_of(frame, o)] for name in AROUND if name in frame.inputs}


def _seconds(o: Compared, start_ns: int) -> Floats:
    """Times since the start, (M,)."""
    found: Floats = (o.t_ns - start_ns) / 1e9
    return found


def _where(places: Mapping[str, Floats], use: NDArray[np.bool_], size: Floats) -> dict[str, list[float]]:
    """Of each place in which the error concentrates, the range in which it does; `size` of the errors that may be
    used."""
    return {name: span for name, at in places.items() if (span := where(at[use], size)) is not None}


def where(place: Floats, size: Floats) -> list[float] | None:
    """The range of `place` in which the error concentrates, or None where it is spread evenly.

    The range of `place` is cut into 8 equal cells; the answer is the contiguous run of cells with a mean error 25 %
    above the whole's that holds most of it, if it holds at least half of the error in at most 60 % of the time.
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


def mean_by_node(channels: Sequence[ChannelErrors], of: Callable[[ChannelErrors], float]) -> dict[str, float]:
    """Node -> the mean of something of its channels, weighted by their samples."""
    return {
        node: float(np.average([of(one) for one in some], weights=[one.samples for one in some]))
        for node, some in _by_node(channels).items()
    }


def largest_by_node(channels: Sequence[ChannelErrors]) -> dict[str, float]:
    """Node -> the largest error of its channels [K]."""
    return {node: max(one.max_K for one in some) for node, some in _by_node(channels).items()}


def _by_node(channels: Sequence[ChannelErrors]) -> dict[str, list[ChannelErrors]]:
    found: dict[str, list[ChannelErrors]] = {}
    for one in channels:
        found.setdefault(one.node, []).append(one)
    return found
