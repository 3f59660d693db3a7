"""What the model gets wrong: size, sign and place of the residuals, against what the channel itself can tell."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ingest.catalogue.channels import ChannelData
from replay.engine.frame.frame import InputFrame
from replay.engine.results.artefacts import AROUND, steps_of
from replay.engine.results.run import Compared, Metered, Observed
from replay.engine.results.summary import ChannelErrors, MeterErrors

Floats = NDArray[np.float64]

CELLS = 8
CONCENTRATED = 1.25  # a cell belongs to "where" if its mean error is this much above the whole's


def errors_of_channels(
    frame: InputFrame, observed: Sequence[Observed], recorded: Sequence[ChannelData]
) -> list[ChannelErrors]:
    """The errors of a run's thermometers, also against readings as recorded; one without a usable step is left out."""
    start = int(frame.t_ns[0])
    found = (channel_errors(o, _around(frame, o, {"temperature_degC": o.measured}), start) for o in observed)
    return with_errors_as_recorded([one for one in found if one is not None], observed, recorded)


def errors_of_meters(frame: InputFrame, meters: Sequence[Metered]) -> list[MeterErrors]:
    """The errors of a run's other meters; one without a usable step is left out."""
    found = (_meter_errors(m, _around(frame, m, {}), int(frame.t_ns[0])) for m in meters)
    return [one for one in found if one is not None]


def channel_errors(observed: Observed, places: Mapping[str, Floats], start_ns: int) -> ChannelErrors | None:
    """The errors of a thermometer over its usable steps; None where it has none. `places`: name with unit -> values
    (M,) at the observed steps, in which the error is located."""
    errors = _errors(observed, places, start_ns, "_K")
    if not errors:
        return None
    highest = int(np.argmax(np.where(observed.usable, observed.measured, -np.inf)))
    return ChannelErrors(
        **errors,
        node=observed.node,
        white_K=observed.sd_K,
        bias_sd_K=observed.bias_sd_K,
        floor_K=observed.floor_K,
        measured_max_degC=float(observed.measured[highest]),
        measured_max_at_s=float((observed.t_ns[highest] - start_ns) / 1e9),
    )


def with_errors_as_recorded(
    errors: Sequence[ChannelErrors], observed: Sequence[Observed], recorded: Sequence[ChannelData]
) -> list[ChannelErrors]:
    """The errors of a run's thermometers; of those whose values the bench file corrects also what the error is without
    that, and by how much the reading was moved. Stamps that were moved stay so."""
    corrected = {one.spec.name: one for one in recorded if one.read is not None}
    of = {one.channel: one for one in observed}
    return [
        _beside(one, of[one.channel], corrected[one.channel]) if one.channel in corrected else one for one in errors
    ]


def _beside(error: ChannelErrors, observed: Observed, channel: ChannelData) -> ChannelErrors:
    use, start = observed.usable, channel.t_ns[0]
    by = np.interp(observed.t_ns[use] - start, channel.t_ns - start, channel.value - channel.recorded)
    return replace(
        error, mae_recorded_K=float(np.abs(observed.residual[use] - by).mean()), reading_moved_K=float(by.mean())
    )


def _meter_errors(metered: Metered, places: Mapping[str, Floats], start_ns: int) -> MeterErrors | None:
    errors = _errors(metered, places, start_ns, "")
    if not errors:
        return None
    return MeterErrors(
        **errors,
        quantity=metered.quantity,
        place=metered.place,
        unit=metered.unit,
        mean=float(metered.measured[metered.usable].mean()),
        white=metered.sd,
        bias_sd=metered.bias_sd,
        gain_sd=metered.gain_sd,
        floor=metered.floor,
    )


def _errors(o: Compared, places: Mapping[str, Floats], start_ns: int, unit: str) -> dict[str, Any]:
    """What both kinds of errors say, names of errors with `unit` at their end; empty without a usable step."""
    use = o.usable
    if not use.any():
        return {}
    residual, t_s = o.residual[use], (o.t_ns[use] - start_ns) / 1e9
    size = np.abs(residual)
    worst = int(np.argmax(size))
    errors = {"mae": float(size.mean()), "max": float(size[worst]), "bias": float(residual.mean())}
    return {
        "channel": o.channel,
        **{name + unit: value for name, value in errors.items()},
        "samples": int(use.sum()),
        "masked": int((~o.used).sum()),
        "max_at_s": float(t_s[worst]),
        "where": {name: span for name, at in places.items() if (span := where(at[use], size)) is not None},
    }


def _around(frame: InputFrame, o: Compared, own: Mapping[str, Floats]) -> dict[str, Floats]:
    """What an error may go with, at the steps of a channel (M,): inputs, `own` and the time since the start."""
    inputs = {name: frame.inputs[name][steps_of(frame, o)] for name in AROUND if name in frame.inputs}
    return {**inputs, **own, "t_s": (o.t_ns - frame.t_ns[0]) / 1e9}


def where(place: Floats, size: Floats) -> list[float] | None:
    """The range of `place` in which the error concentrates, or None where it is spread evenly: of 8 equal cells the
    contiguous run with a mean error 25 % above the whole's that holds most of it, if that is at least half of the error
    in at most 60 % of the time."""
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
