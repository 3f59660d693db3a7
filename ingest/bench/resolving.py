"""The channels of a bench file for one log: each with its signals, its conversion to the stored unit, and every default
filled in."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

from ingest.bench.bench_file import Bench
from ingest.bench.channel import Channel
from ingest.bench.signals import TABLE, Directory, Signal
from ingest.errors import BenchFileError
from ingest.texts.expressions import Expression, parse
from ingest.texts.nearest import hint
from ingest.texts.quantities import STORED_UNIT, Conversion, column_suffix, converter, other_unit

_REGIONS = (  # without a motor file, by the beginning of a node's name
    ("copper", r"(winding|endwinding|terminal)"),
    ("iron", r"(yoke|teeth|tooth|stator|iron)"),
    ("boundary", r"(oven|ambient|coolant)"),
)
_NOISE_K, _BIAS_K = 0.1, 0.5  # of temperatures, where the bench file says none
_GAIN = {"power": 0.005, "heat": 0.03, "resistance": 0.002, "flux": 0.01}  # sd of observed ones, where it says none


@dataclass(frozen=True, kw_only=True)
class ResolvedChannel(Channel):
    """A channel of the bench file as it holds for one log, with every default filled in. A `resolution` of None is the
    smallest step in the data (`with_step`), a `reference` of None what the session begins with.

    `signals` are those that it `needs`, in this order; `conversion` leads from `unit` (of the file, or of the
    expression's result) to the stored unit.
    """

    conversion: Conversion
    signals: tuple[Signal, ...]
    role: str = field()
    noise: float = 0.0  # one sigma, white
    bias_sd: float = 0.0
    gain_sd: float = 0.0
    noise_given: bool = True  # by the bench file

    @cached_property
    def formula(self) -> Expression | None:
        """The expression of a derived channel."""
        return parse(self.expression) if self.expression else None

    @property
    def derived(self) -> bool:
        return self.expression is not None

    @property
    def stored_unit(self) -> str:
        return STORED_UNIT[self.quantity]

    @property
    def column(self) -> str:
        """Name of its column: the channel's and the stored unit's ("EW_A_3v_degC")."""
        return self.name + column_suffix(self.quantity)

    def with_step(self, step: float) -> ResolvedChannel:
        """The channel with the smallest step seen in the data (stored unit) as resolution, where none was known."""
        if self.resolution is not None:
            return self
        return replace(self, resolution=step, noise=self.noise if self.noise_given else max(self.noise, step / 3))


def resolve(
    bench: Bench,
    signals: Sequence[Signal],
    boundaries: Collection[str] | None = None,
    regions: Mapping[str, str] | None = None,
) -> list[ResolvedChannel]:
    """The channels of `bench` for a log that holds `signals`, in the order of the file.

    `boundaries`: those of the motor file; None without one, then the names tell. `regions`: of its nodes, None without
    one. Ignored channels that are not in the log are left out. Raises BenchFileError for a signal that is not there or
    not the only one, and a unit that the log's own unit row contradicts.
    """
    directory = Directory(signals)
    found = [(channel, _signals_of(channel, bench, directory)) for channel in bench.channels if channel.quantity]
    present = [(channel, of_log) for channel, of_log in found if of_log]
    _refuse_twice(bench, present)
    names = Counter(_bare(channel, of_log) for channel, of_log in present)
    resolved = []
    for channel, of_log in present:
        _refuse_name(bench, channel, directory)
        bare = _bare(channel, of_log)
        name = bare if names[bare] == 1 else channel.was or str(channel.signal)
        resolved.append(_filled(channel, of_log, name, boundaries, regions))
    return resolved


def valued(bench: Bench) -> list[ResolvedChannel]:
    """The channels of `bench` that are a number for all its logs."""
    return [
        ResolvedChannel(**vars(channel), conversion=Conversion(), signals=())
        for channel in bench.channels
        if channel.value is not None
    ]


def observing(bench: Bench, boundaries: Collection[str], regions: Mapping[str, str]) -> list[ResolvedChannel]:
    """The channels of `bench` that observe the motor, as they hold before there is any log; arguments as of
    `resolve`."""
    measured = (channel for channel in bench.channels if channel.quantity and channel.value is None)
    found = [_filled(channel, (Signal(channel.name),), channel.name, boundaries, regions) for channel in measured]
    return [channel for channel in found if channel.role == "observed"]


def check_nodes(bench: Bench, nodes: Collection[str], boundaries: Collection[str]) -> None:
    """Raises BenchFileError for a node that the motor file does not have, and for a boundary among weights."""
    known = [*nodes, *boundaries]
    for channel in bench.channels:
        key = "weights" if "weights" in channel.lines else "node"
        where = f"{bench.name}:{channel.at(key)}:"
        for place in () if channel.role == "ignored" else _places(channel):
            if channel.value is not None and place not in boundaries:
                says = (
                    f'node = "{place}" has a value, but is no boundary of the motor file: what a node has is computed.'
                )
                raise BenchFileError(f"{where} {says} Its boundaries: {', '.join(boundaries)}.")
            if place not in known:
                advice = hint(place, known) or f" It has: {', '.join(known)}."
                raise BenchFileError(f'{where} node "{place}" of {channel.called} is not in the motor file.{advice}')
            if place in channel.weights and place in boundaries:
                raise BenchFileError(
                    f'{where} {key} of {channel.called} hold "{place}", a boundary, but weights are of nodes only. '
                    f'Take it out, or write node = "{place}" alone.'
                )


def region_by_name(node: str) -> str | None:
    """The region of a node where no motor file gives it; None where its name tells nothing."""
    return next((region for region, begins in _REGIONS if re.match(begins, node)), None)


def _places(channel: Channel) -> list[str]:
    return list(channel.weights) or ([channel.node] if channel.node else [])


def _bare(channel: Channel, of_log: Sequence[Signal]) -> str:
    if channel.was and of_log[0].message is None:
        return channel.was.removeprefix(f"{TABLE}.")
    return channel.name if channel.expression or channel.was else of_log[0].name


def _signals_of(channel: Channel, bench: Bench, directory: Directory) -> tuple[Signal, ...]:
    """The signals a channel needs; () for an ignored channel of which one is missing."""
    matches = [directory.find(name) for name in channel.needs]
    if channel.role == "ignored" and not all(matches):
        return ()
    return tuple(
        _only(name, found, channel, bench, directory) for name, found in zip(channel.needs, matches, strict=True)
    )


def _only(name: str, found: list[Signal], channel: Channel, bench: Bench, directory: Directory) -> Signal:
    key = "expression" if channel.expression else "signal"
    where = f"{bench.name}:{channel.at(key)}:"
    what = f'signal "{name}"' + (f' in the expression of "{channel.name}"' if channel.expression else "")
    if not found:
        todo = "Correct the expression," if channel.expression else 'Correct the name, add role = "ignored",'
        advice = f"{directory.nearest(name)} {todo} or give the log that holds it in the same command."
        raise BenchFileError(f"{where} {what} is not in the logs.{advice}")
    if len({signal if signal.message else signal.name for signal in found}) > 1:  # a column of several tables is one
        several = ", ".join(sorted({signal.alone for signal in found}))
        quotes = " in backquotes" if channel.expression else ""
        raise BenchFileError(f"{where} {what} is not unique: {several}. Write one of these{quotes}.")
    return found[0]


def _refuse_twice(bench: Bench, present: Sequence[tuple[Channel, tuple[Signal, ...]]]) -> None:
    seen: dict[Signal, Channel] = {}
    for channel, of_log in present:
        first = channel if channel.expression else seen.setdefault(of_log[0], channel)
        if first is not channel:
            raise BenchFileError(
                f'{bench.name}:{channel.at("signal")}: signal "{channel.signal}" is the one of line '
                f'{first.at("signal")} ("{first.signal}"). Keep one of the two.'
            )


def _refuse_name(bench: Bench, channel: Channel, directory: Directory) -> None:
    """A derived channel becomes a column beside the signals: it cannot have the name of one."""
    if channel.expression and directory.find(channel.name):
        raise BenchFileError(
            f'{bench.name}:{channel.at("name")}: derived channel "{channel.name}" has the name of a signal in the log, '
            f"{directory.find(channel.name)[0]}. Give it another name."
        )


def refuse_unit_row(bench: Bench, columns: Mapping[str, str], log: str) -> None:
    """Raises BenchFileError for a unit that the unit row of a table contradicts: column -> unit. A table says its units
    itself; a database's units are known to be careless, there the bench file is right."""
    directory = Directory([Signal(name, unit=unit) for name, unit in columns.items()])
    for channel in bench.channels:
        for signal in directory.find(channel.signal) if channel.signal and channel.quantity else ():
            if signal.unit and other_unit(signal.unit, channel.unit, channel.quantity, channel.convention):
                raise BenchFileError(
                    f'{bench.name}:{channel.at("unit")}: unit "{channel.unit}" of signal "{channel.signal}" disagrees '
                    f'with {log}, which says "{signal.unit}". Correct the bench file, or give that log one of its own.'
                )


def _filled(
    channel: Channel,
    of_log: tuple[Signal, ...],
    name: str,
    boundaries: Collection[str] | None,
    regions: Mapping[str, str] | None,
) -> ResolvedChannel:
    conversion = converter(channel.unit, channel.quantity, channel.convention)
    role = channel.role or _role(channel, boundaries)
    temperature = channel.quantity == "temperature"
    resolution = channel.resolution
    if resolution is None and not channel.expression and of_log[0].resolution:
        resolution = of_log[0].resolution * conversion.scale
    noise = max((resolution or 0.0) / 3, _NOISE_K if temperature else 0.0)
    observed = role == "observed"
    bias_sd = _BIAS_K if temperature and observed else 0.0
    gain_sd = _GAIN.get(channel.quantity, 0.0) if observed else 0.0
    filled = {
        "name": name,
        "role": role,
        "region": _region(channel, boundaries, regions),
        "resolution": resolution,
        "noise": noise if channel.noise is None else channel.noise,
        "bias_sd": bias_sd if channel.bias_sd is None else channel.bias_sd,
        "gain_sd": gain_sd if channel.gain_sd is None else channel.gain_sd,
    }
    given = channel.noise is not None
    return ResolvedChannel(**vars(channel) | filled, conversion=conversion, signals=of_log, noise_given=given)


def _role(channel: Channel, boundaries: Collection[str] | None) -> str:
    """Whether a channel is observed or an input: temperatures of nodes are observed, all else is input."""
    places = _places(channel) if channel.quantity == "temperature" else []
    outside = [_outside(place, channel.region, boundaries) for place in places]
    return "observed" if places and not all(outside) else "input"


def _region(channel: Channel, boundaries: Collection[str] | None, regions: Mapping[str, str] | None) -> str | None:
    """The region of what a channel measures: as the motor file says of its node (of several the heaviest), else as the
    channel says, else by the node's name."""
    heaviest = max(channel.weights, key=lambda node: channel.weights[node]) if channel.weights else channel.node
    if heaviest is None or regions is None:
        return channel.region or (region_by_name(heaviest) if heaviest else None)
    return "boundary" if heaviest in (boundaries or ()) else regions.get(heaviest)


def _outside(place: str, region: str | None, boundaries: Collection[str] | None) -> bool:
    """Whether a place is a boundary; where no motor file says so, the channel's region or the name does."""
    return (region or region_by_name(place)) == "boundary" if boundaries is None else place in boundaries
