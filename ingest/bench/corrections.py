"""What a bench is known to get wrong, and how it is taken off: the `[[correction]]` tables of a bench file.

A correction is named by the id of its cause, `kind.place.law`: the kind ends at the first dot, the place at the second.
Its amount is reading minus truth. Corrections are taken off in the order of the file, each from what those above it
left; so a place is called what it is called after the exchanges above. `ingest.bench.laws` says what each law takes
off; besides, a lag is added to the `time_constant_s` of its channel, and exchanged sensors take over each other's node.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from zoneinfo import ZoneInfo

from ingest.bench.changes import moment_ns
from ingest.bench.channel import Channel
from ingest.bench.channel_tables import refusal
from ingest.bench.laws import AMBIENT, CURRENT, LAWS, SWAP, THERE_OR_NOT, Array, CorrectionLaw, Surroundings, Times
from ingest.errors import BenchFileError
from ingest.texts.nearest import hint
from ingest.texts.toml_file import NUMBER, TEXT, TomlTable

KEYS = ("cause", "amount", "from", "until")
OF_THE_MOTOR = ("loss", "conductance", "capacity", "ageing")


@dataclass(frozen=True)
class Correction:
    """One `[[correction]]`: the id of a cause, and reading minus truth in the unit of its law."""

    cause: str
    amount: float
    from_ns: int | None = None  # what it holds from [ns UTC], None from the first log on
    until_ns: int | None = None  # before which it holds, None to the last log
    line: int = field(default=0, compare=False)  # of the bench file; 0 where it is not in it yet

    def holds_at(self, t_ns: int) -> bool:
        """Whether it is to be taken off what begins at a moment [ns UTC]."""
        return (self.from_ns is None or self.from_ns <= t_ns) and (self.until_ns is None or t_ns < self.until_ns)

    @property
    def kind(self) -> str:
        return self.cause.split(".", 2)[0]

    @property
    def place(self) -> str:
        return self.cause.split(".", 2)[1]

    @property
    def law(self) -> str:
        return self.cause.split(".", 2)[2]

    @property
    def says(self) -> str:
        """ "clock.thermo.offset 24 s"."""
        return f"{self.cause} {self.amount:g} {self.rule.unit}".rstrip()

    @property
    def rule(self) -> CorrectionLaw:
        """What its law does, of one that a bench can have."""
        return THERE_OR_NOT if self.law.startswith(SWAP) else LAWS[self.kind][self.law]


@dataclass(frozen=True)
class Target:
    """What a correction concerns: two with equal targets say the same thing."""

    law: str  # of a clock with its bus
    channels: frozenset[int]  # positions in the bench file
    held: tuple[int | None, int | None] = (None, None)  # from when, until when [ns UTC]


@dataclass(frozen=True)
class Corrected:
    """A bench file's channels under corrections."""

    channels: tuple[Channel, ...]  # each with the node that it truly measures, and its whole lag
    steps: tuple[tuple[Correction, ...], ...]  # for each, what is to be taken off its values, in order
    targets: tuple[Target, ...]  # one a correction


def spelt(name: str) -> str:
    """A signal's or file's name as ids hold it: every character but letters, digits and `_` as `_`."""
    return re.sub(r"\W", "_", name)


def read_corrections(tables: Sequence[TomlTable], zone: ZoneInfo) -> tuple[Correction, ...]:
    """The corrections of a bench file, dates without an offset in `zone`.

    Raises TomlError for a table of another shape, BenchFileError for dates that leave no time between them.
    """
    return tuple(_read(table, zone) for table in tables)


def check_corrections(file: str, channels: Sequence[Channel], corrections: Sequence[Correction]) -> None:
    """Raises BenchFileError for a cause that is none of a bench, a place that one with these channels does not have, an
    amount that cannot be, and what stands here twice; each with the line."""
    targets = correct(file, channels, corrections).targets
    for i, target in enumerate(targets):
        if target in targets[:i]:
            first = corrections[targets.index(target)]
            raise _refusal(file, corrections[i], f"is the correction of line {first.line}: keep one.")


def correct(file: str, channels: Sequence[Channel], corrections: Iterable[Correction]) -> Corrected:
    """The channels of the bench file `file` (as in messages) under `corrections`. Raises BenchFileError."""
    now = list(channels)
    steps: list[tuple[Correction, ...]] = [()] * len(now)
    targets = []
    for one in corrections:
        _check(file, one)
        at = _places(file, one, now)
        if one.law == "lag" and at:  # of a clock it is told where the bus is known
            now[at[0]] = _slower(file, now[at[0]], one)
        elif one.law.startswith(SWAP):
            a, b = (now[i] for i in at)
            now[at[0]], now[at[1]] = _measuring(a, b), _measuring(b, a)
        elif one.rule.off is not None:
            for i in at:
                steps[i] = (*steps[i], one)
        law = SWAP if one.law.startswith(SWAP) else f"{one.place}.{one.law}" if one.kind == "clock" else one.law
        targets.append(Target(law, frozenset(at), (one.from_ns, one.until_ns)))
    return Corrected(tuple(now), tuple(steps), tuple(targets))


def in_order(amounts: Mapping[str, float]) -> dict[str, float]:
    """Cause -> amount in the order in which they are best taken off: exchanges, which rename the places below, then
    what is added to readings, then factors."""
    return dict(sorted(amounts.items(), key=lambda one: Correction(*one).rule.turn))


def true_times(t_ns: Times, corrections: Iterable[Correction], bus: str, start_ns: int) -> Times:
    """Stamps (N,) [ns] of a bus without what its clock is late by; a clock drifts from `start_ns` on."""
    for one in corrections:
        if (one.kind, one.place) == ("clock", spelt(bus)) and one.rule.true_stamps is not None:
            t_ns = one.rule.true_stamps(t_ns, one.amount, start_ns)
    return t_ns


def logger_lag_s(corrections: Iterable[Correction], bus: str) -> float:
    """By how much more slowly than stated everything follows that a bus records [s]."""
    return sum(one.amount for one in corrections if (one.kind, one.place, one.law) == ("clock", spelt(bus), "lag"))


def true_values(value: Array, steps: Iterable[Correction], beside: Surroundings) -> Array:
    """Values (N,) in the stored unit without what `steps` say is wrong with them. What needs something that the session
    does not know stays in."""
    for one in steps:
        rule = one.rule
        if rule.off is not None and (not rule.needs or rule.needs in beside.known):
            value = rule.off(value, one.amount, beside)
    return value


def _refusal(file: str, one: Correction, says: str) -> BenchFileError:
    line = f":{one.line}" if one.line else ""
    return BenchFileError(f'{file}{line}: correction "{one.cause}" {says}')


def _read(table: TomlTable, zone: ZoneInfo) -> Correction:
    table.only(KEYS)
    from_ns, until_ns = moment_ns(table, "from", zone), moment_ns(table, "until", zone)
    if from_ns is not None and until_ns is not None and until_ns <= from_ns:
        raise refusal(table, "until", "until is not after from: then it never holds.")
    cause, amount = table.need("cause", TEXT), table.need("amount", NUMBER)
    return Correction(cause, amount, from_ns, until_ns, table.line("cause"))


def _check(file: str, one: Correction) -> None:
    """Whether a bench file may say this at all, of whatever place."""
    if len(one.cause.split(".", 2)) < 3:
        raise _refusal(file, one, "is no cause: write kind.place.law, such as sensor.magnet.bias.")
    if one.kind in OF_THE_MOTOR:
        raise _refusal(file, one, f"is of the motor, not of the bench: a {one.kind} belongs in the motor file.")
    if one.kind not in LAWS:
        raise _refusal(file, one, f"is of no kind that a bench has: {', '.join(LAWS)}.{hint(one.kind, LAWS)}")
    laws, swap = LAWS[one.kind], one.kind == "sensor" and one.law.startswith(SWAP)
    if one.law not in laws and not swap:
        raise _refusal(file, one, f"has a law that no {one.kind} has: {', '.join(laws)}.{hint(one.law, laws)}")
    if not one.rule.fits(one.amount):
        raise _refusal(file, one, f"{one.rule.refusal}, found {one.amount:g}.")


def _places(file: str, one: Correction, channels: Sequence[Channel]) -> tuple[int, ...]:
    """Positions of the channels that a correction concerns; none for a clock, of which a bench file knows nothing."""
    match one.kind:
        case "clock":
            if re.fullmatch(r"\w+", one.place) is None:
                raise _refusal(
                    file, one, "names no clock: write a bus such as can2, a [[logger]], or the stem of a log's name."
                )
            return ()
        case "input":
            return _inputs(file, one, channels)
        case "boundary":
            around = _by_name((c.node, i) for i, c in enumerate(channels) if _is_temperature(c) and c.node)
            return tuple(_known(file, one, one.place, around, "no channel measures"))
    sensors = _sensors(channels)
    here = _one_sensor(file, one, one.place, sensors)
    _check_beside(file, one, channels, here)
    if not one.law.startswith(SWAP):
        return (here,)
    other = _one_sensor(file, one, one.law.removeprefix(SWAP), sensors)
    if other == here:
        raise _refusal(file, one, "exchanges a sensor with itself: name two.")
    return (here, other)


def _check_beside(file: str, one: Correction, channels: Sequence[Channel], here: int) -> None:
    """Whether what a correction of the channel `here` needs beside its readings is measured."""
    needs = one.rule.needs
    if needs == AMBIENT:
        if not any(c.node == AMBIENT for c in channels if _is_temperature(c)):
            raise _refusal(file, one, f'needs the ambient: add the channel that measures it, with node = "{AMBIENT}".')
        if channels[here].node == AMBIENT:
            raise _refusal(file, one, "is of the ambient itself: take it out.")
    elif needs:
        given = {c.quantity for c in channels if c.role != "ignored"}
        parts = {"current_d", "current_q"} if needs == CURRENT else {needs}
        if needs not in given and not parts <= given:
            raise _refusal(file, one, f'needs the {needs}: add the channel that measures it, quantity = "{needs}".')


def _is_temperature(channel: Channel) -> bool:
    return channel.quantity == "temperature" and channel.role != "ignored"


def _by_name(pairs: Iterable[tuple[str | None, int]]) -> dict[str, list[int]]:
    found: dict[str, list[int]] = {}
    for name, i in pairs:
        found.setdefault(str(name), []).append(i)
    return found


def _sensors(channels: Sequence[Channel]) -> dict[str, list[int]]:
    """Every name that a sensor may go by -> those that go by it: `node@signal` of every node that it follows a part of,
    so that a correction still finds its sensor when the shares are learnt anew; and the bare node of those that follow
    it most, of the sensors that follow no other node more."""
    names: list[tuple[str | None, int]] = []
    nearest: dict[str, list[tuple[float, int]]] = {}
    for i, channel in enumerate(channels):
        if _is_temperature(channel) and channel.role != "input" and (channel.node or channel.weights):
            shares = channel.weights or {str(channel.node): 1.0}
            signals = {spelt(channel.name), spelt(channel.signal or channel.name)}
            names += [(f"{node}@{signal}", i) for node in shares for signal in sorted(signals)]
            first = max(shares, key=lambda name: shares[name])
            nearest.setdefault(first, []).append((shares[first], i))
    for node, own in nearest.items():
        most = max(share for share, _ in own)
        names += [(node, i) for share, i in own if share == most]
    return _by_name(names)


def _one_sensor(file: str, one: Correction, place: str, sensors: Mapping[str, list[int]]) -> int:
    found = _known(file, one, place, sensors, "no channel measures")
    if len(found) > 1:
        several = ", ".join(name for name, at in sensors.items() if "@" in name and len(at) == 1 and at[0] in found)
        raise _refusal(file, one, f'may mean several sensors of "{place}": write one of {several}.')
    return found[0]


def _inputs(file: str, one: Correction, channels: Sequence[Channel]) -> tuple[int, ...]:
    """The input channels of a quantity; of `flow_<circuit>` the one with that name, else all of the flow."""
    given = [
        (i, channel)
        for i, channel in enumerate(channels)
        if channel.role not in ("ignored", "observed") and channel.quantity not in ("", "temperature")
    ]
    by_quantity = _by_name((channel.quantity, i) for i, channel in given)
    if one.place.startswith("flow_") and "flow" in by_quantity:
        own = [i for i in by_quantity["flow"] if channels[i].name == one.place]
        return tuple(own or by_quantity["flow"])
    return tuple(_known(file, one, one.place, by_quantity, "no input gives"))


def _known(file: str, one: Correction, place: str, known: Mapping[str, list[int]], what: str) -> list[int]:
    if place not in known:
        there = hint(place, known) or f" There are: {', '.join(sorted(known)) or 'none'}."
        raise _refusal(file, one, f'names a place that this bench does not have: {what} "{place}".{there}')
    return known[place]


def _slower(file: str, channel: Channel, one: Correction) -> Channel:
    lag = channel.time_constant_s + one.amount
    if lag < 0.0:
        raise _refusal(file, one, f"leaves a lag of {lag:g} s: {channel.called} has {channel.time_constant_s:g} s.")
    return replace(channel, time_constant_s=lag)


def _measuring(channel: Channel, other: Channel) -> Channel:
    """`channel` at the place of `other`."""
    return replace(channel, node=other.node, weights=other.weights, region=other.region)
