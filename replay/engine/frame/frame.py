"""The input frame: the one narrow door into the twin, made from a session's channels and recorded whole.

Per step: mean of every feature, mean of every boundary temperature, and per observed channel the mean of its samples
with the first and last record used (its lineage).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ingest.catalogue.kinds import STANDSTILL_rpm
from ingest.catalogue.power import RPM
from ingest.texts.nearest import hint
from ingest.texts.quantities import STORED_UNIT, column_suffix
from ingest.texts.times import clock
from replay.engine.frame.inputs import InputSamples, bridge, longest_stretch, pieces
from replay.engine.frame.meters import SHAFT, measurands
from replay.engine.frame.observations import Meter, Observation, observe
from replay.errors import ReplayDataError
from twin.motor.features import Monomial, evaluate, is_flow, scale
from twin.motor.network import Network
from twin.run.initial import time_constants

if TYPE_CHECKING:
    from ingest.catalogue.channels import ChannelData

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Times = NDArray[np.int64]

CHUNK_STEPS = 4096  # the finest pieces of this many steps are in memory at once


@dataclass(frozen=True)
class InputFrame:
    """A session in N equal steps, as the twin takes it. `t_ns` (N + 1,) int64: edges of the steps; means over the
    steps: `features` (N, m) of the `monomials`, `boundaries` (N, b) [degC] and `inputs`, column with unit -> (N,);
    `mechanical_W` (N,) of torque times speed, None where one of them is not recorded, or twice. `live` (N,): False
    where an input was bridged; `note`: what of the session was left out, or None."""

    t_ns: Times
    step_s: float
    monomials: tuple[Monomial, ...]
    features: Floats
    boundaries: Floats
    boundary_names: tuple[str, ...]
    inputs: Mapping[str, Floats]
    live: Bools
    observations: tuple[Observation, ...]
    raw_files: tuple[str, ...]
    note: str | None
    meters: tuple[Meter, ...] = ()
    mechanical_W: Floats | None = None


def build(
    channels: Sequence[ChannelData],
    good: Sequence[Bools],
    network: Network,
    monomials: tuple[Monomial, ...],
    step_s: float,
    given: Mapping[str, float] | None = None,
) -> InputFrame:
    """The frame of a session for a network.

    `good`: per channel, which samples of an observation may be believed (ingest.catalogue.quality). Inputs are taken as
    they stand: a held set point and a constant one look the same, and the bench really ran at one of them. `given`:
    features that no channel gives and that are one number in a session, in their scale. Flux is 0 at standstill,
    whatever its channel says. Raises ReplayDataError where an input or a boundary that the network needs has no
    channel, two channels, or no samples, and where nothing says which channel is which of several flows.
    """
    by_name, given = {c.spec.name: c for c in channels}, given or {}
    used = sorted({feature for m in monomials for feature in m.features})
    flows = [f for f in used if is_flow(f)]
    needed = {f: _input_of(f, flows, channels) for f in used if f not in given}
    turning = None
    if "flux" in needed:
        turning = _only("speed", '"flux", which is 0 at standstill', _inputs("speed", channels)).spec.name
    around = {b.name: _boundary_of(b.name, channels) for b in network.boundaries}
    names = {c.spec.name for c in (*needed.values(), *(c for group in around.values() for c in group))}
    names |= {turning} if turning is not None else set()
    observed = _observed_temperatures(channels, network)
    metered = measurands(channels, network)
    shaft = _shaft(channels)
    if any(what.quantity == "power" for what in metered.values()):
        names |= set(shaft)
    signals = {name: _signal(by_name[name]) for name in sorted(names)}
    edges, note = _edges(signals, step_s, channels)
    others = (c for c in channels if c.spec.role == "input" and c.spec.name not in names and c.t_ns.size > 1)
    shown = signals | {c.spec.name: _signal(c) for c in others}
    features, boundaries, means, mechanical_W = _averages(
        shown, needed, given, turning, around, shaft, network, monomials, edges
    )
    columns = _columns(channels, {c.spec.name: f for f, c in needed.items() if is_flow(f)})
    raw_files = tuple(sorted({file for c in channels for file in c.raws}))
    seen = {c.spec.name: (c, g) for c, g in zip(channels, good, strict=True)}
    return InputFrame(
        t_ns=edges,
        step_s=step_s,
        monomials=monomials,
        features=features,
        boundaries=boundaries,
        boundary_names=tuple(around),
        inputs={columns[name]: means[name] for name in means if name in columns},
        live=_live(signals.values(), edges, recovery_s(network, features.mean(axis=0), channels)),
        observations=tuple(observe(c, g, edges, raw_files) for name, (c, g) in seen.items() if name in observed),
        raw_files=raw_files,
        note=note,
        meters=tuple(Meter(what, observe(*seen[name], edges, raw_files)) for name, what in metered.items()),
        mechanical_W=mechanical_W,
    )


def _shaft(channels: Sequence[ChannelData]) -> tuple[str, ...]:
    """The channels of torque and speed, () where one of them is not there, or not the only one."""
    found = [[c for c in _inputs(quantity, channels) if c.t_ns.size > 1] for quantity in SHAFT]
    return tuple(one.spec.name for (one,) in found) if all(len(some) == 1 for some in found) else ()


def _columns(channels: Sequence[ChannelData], flows: Mapping[str, str]) -> dict[str, str]:
    """Channel -> its column with unit. The column is called after the quantity where that has one input only
    (`speed_rpm`), after the boundary or node of a temperature (`coolant_degC`), after the feature of one of the motor's
    `flows` (channel -> feature), else after the channel."""
    inputs = [c.spec for c in channels if c.spec.role == "input"]
    alone = {q for q, count in Counter(spec.quantity for spec in inputs).items() if count == 1 and q != "temperature"}
    stems = {s.name: s.quantity if s.quantity in alone else s.node or s.name for s in inputs} | dict(flows)
    shared = {stem for stem, count in Counter(stems.values()).items() if count > 1}
    return {
        spec.name: column_name(spec.name if stems[spec.name] in shared else stems[spec.name], spec.quantity)
        for spec in inputs
    }


def column_name(name: str, quantity: str) -> str:
    """`coolant` of quantity temperature -> `coolant_degC` (INTERFACES: the unit is in the name)."""
    suffix = column_suffix(quantity)
    return name if name.endswith(suffix) else name + suffix


def _input_of(feature: str, flows: Sequence[str], channels: Sequence[ChannelData]) -> ChannelData:
    """The channel of a feature; `flows`: all flows that are needed."""
    quantity = "flow" if is_flow(feature) else feature
    if quantity not in STORED_UNIT:
        raise ReplayDataError(
            f'feature "{feature}" of the motor file is counted over the sessions of a specimen, which is not done '
            "here: `whyhot replay` does. Take the term out, or use a motor file without it."
        )
    found = _inputs(quantity, channels)
    return _only(quantity, f'"{feature}"', _flow_of(feature, flows, found) if is_flow(feature) else found)


def _inputs(quantity: str, channels: Sequence[ChannelData]) -> list[ChannelData]:
    return [c for c in channels if c.spec.quantity == quantity and c.spec.role == "input"]


def _only(quantity: str, why: str, found: Sequence[ChannelData]) -> ChannelData:
    if not found:
        raise ReplayDataError(
            f"the motor file uses {why}, and no channel of this session gives {quantity}: "
            f'add a [[channel]] or [[derived]] with quantity = "{quantity}" to the bench file.'
        )
    if len(found) > 1:
        several = f"{len(found)} channels give {quantity} ({_named(found)})"
        raise ReplayDataError(f'{several}: set role = "ignored" on all but one.')
    return found[0]


def _flow_of(feature: str, flows: Sequence[str], found: Sequence[ChannelData]) -> list[ChannelData]:
    """The channels that may be the flow `feature`: the one of its name; of a motor's only flow the only channel of
    flow, whatever its name; of plain `flow` beside others any channel that has the name of none of them. Raises
    ReplayDataError where a name has to say it, and none does."""
    own = [c for c in found if c.spec.name == feature]
    if flows == ["flow"] or (len(flows) == 1 and len(found) < 2):
        return list(found)
    if own or feature == "flow":
        return own or [c for c in found if c.spec.name not in flows]
    raise ReplayDataError(
        f'the motor file uses "{feature}", and no channel of this session is called so (of flow there are: '
        f"{_named(found) or 'none'}): add a [[derived]] of that name, or a [[channel]] where a signal has it, with "
        'quantity = "flow" to the bench file.'
    )


def _named(channels: Sequence[ChannelData]) -> str:
    return ", ".join(c.spec.name for c in channels)


def _boundary_of(name: str, channels: Sequence[ChannelData]) -> list[ChannelData]:
    known = (c for c in channels if c.spec.quantity == "temperature" and c.spec.role != "ignored")
    found = [c for c in known if c.spec.node == name]
    if not found:
        raise ReplayDataError(
            f'boundary "{name}" of the motor file has no channel in this session: '
            f'add node = "{name}" to the channel that measures it in the bench file.'
        )
    return found


def _observed_temperatures(channels: Sequence[ChannelData], network: Network) -> set[str]:
    """Names of the thermometers that observe nodes of this network: none at a boundary, whatever it is called."""
    nodes, around = {n.name for n in network.nodes}, {b.name for b in network.boundaries}
    found = set()
    for spec in (c.spec for c in channels if c.spec.role == "observed" and c.spec.quantity == "temperature"):
        places = list(spec.weights) or [spec.node or ""]
        missing = [place for place in places if place not in nodes]
        if missing and not (len(places) == 1 and places[0] in around):
            raise ReplayDataError(
                f'channel "{spec.name}" observes node "{missing[0]}", and motor "{network.name}" has no such node.'
                f"{hint(missing[0], nodes)} Replay with a model that has it, or correct the bench file."
            )
        if not missing:
            found.add(spec.name)
    return found


def _signal(channel: ChannelData) -> InputSamples:
    if (count := channel.t_ns.size) < 2:
        name = channel.spec.name
        raise ReplayDataError(f'channel "{name}" has {count} usable samples: too little to replay. See `whyhot show`.')
    return bridge(channel.t_ns, channel.value)


def _edges(
    signals: Mapping[str, InputSamples], step_s: float, channels: Sequence[ChannelData]
) -> tuple[Times, str | None]:
    """The edges of the steps, and what is left out of all that `channels` recorded."""
    start, end = longest_stretch(signals)
    step_ns = round(step_s * 1e9)
    # the last sample holds for one of its own intervals
    steps = (end - start + min(int(np.median(np.diff(s.t_ns))) for s in signals.values())) // step_ns
    if steps < 10:
        known_s = (end - start) / 1e9
        raise ReplayDataError(f"inputs overlap for {known_s:.0f} s only: too little to replay. See `whyhot show`.")
    recorded = [c.t_ns for c in channels if c.t_ns.size and c.spec.role != "ignored"]
    first_ns = min(int(t[0]) for t in recorded)
    whole_ns = max(int(t[-1]) for t in recorded) - first_ns
    left_out = (whole_ns - (end - start)) / 1e9
    note = _left_out(start - first_ns, end - first_ns, whole_ns) if left_out > 60 else None
    return start + step_ns * np.arange(steps + 1, dtype=np.int64), note


def _left_out(start_ns: int, end_ns: int, whole_ns: int) -> str:
    """What of a session is replayed, and why not all of it; all times of a run count from where it begins."""
    begin, end, whole = (clock(ns / 1e9) for ns in (start_ns, end_ns, whole_ns))
    counted = f"; times count from {begin}" if start_ns else ""
    return (
        f"{begin} to {end} of {whole} replayed: elsewhere inputs are silent for more than 10 minutes, or not all "
        f"there{counted}"
    )


def _averages(
    signals: Mapping[str, InputSamples],
    needed: Mapping[str, ChannelData],
    given: Mapping[str, float],
    turning: str | None,
    around: Mapping[str, Sequence[ChannelData]],
    shaft: Sequence[str],
    network: Network,
    monomials: tuple[Monomial, ...],
    edges: Times,
) -> tuple[Floats, Floats, dict[str, Floats], Floats | None]:
    features, boundaries, mechanical = [], [], []
    means: dict[str, list[Floats]] = {name: [] for name in signals}
    for at in range(0, edges.size - 1, CHUNK_STEPS):
        part = pieces(signals, edges[at : at + CHUNK_STEPS + 1])
        scaled = {f: part.values[c.spec.name] / scale(network, f) for f, c in needed.items()}
        scaled |= {f: np.full(part.weight.size, value) for f, value in given.items()}
        if turning is not None:
            scaled["flux"] = np.where(np.abs(part.values[turning]) < STANDSTILL_rpm, 0.0, scaled["flux"])
        features.append(part.mean(evaluate(monomials, scaled, part.weight.size)))
        outside = [np.mean([part.values[c.spec.name] for c in group], axis=0) for group in around.values()]
        boundaries.append(part.mean(np.stack(outside, axis=1)))
        if shaft:
            torque, speed = (part.values[name] for name in shaft)
            mechanical.append(part.mean(torque * speed * RPM))
        for name, values in part.values.items():
            means[name].append(part.mean(values))
    whole = {name: np.concatenate(m) for name, m in means.items()}
    power = np.concatenate(mechanical) if mechanical else None
    return np.concatenate(features), np.concatenate(boundaries), whole, power


def _live(signals: Iterable[InputSamples], edges: Times, recover_s: float) -> Bools:
    """Which steps (N,) can be trusted: not those with a bridged input, nor later ones until nodes have forgotten it."""
    live = np.ones(edges.size - 1, dtype=np.bool_)
    for signal in signals:
        for start, end in signal.gaps:
            until = np.searchsorted(edges, end + round(recover_s * 1e9))
            live[max(np.searchsorted(edges, start, side="right") - 1, 0) : until] = False
    return live


def recovery_s(network: Network, mean_features: Floats, channels: Sequence[ChannelData]) -> float:
    """How long observed nodes remember a bridged input [s]: 3 times the time constant C / sum G of the quickest of
    them, at mean features."""
    observed = (c.spec for c in channels if c.spec.role == "observed")
    seen = {node for spec in observed for node in (spec.weights or [spec.node])}
    constants = time_constants(network, mean_features)
    return 3.0 * min((constants[n.name] for n in network.nodes if n.name in seen), default=0.0)
