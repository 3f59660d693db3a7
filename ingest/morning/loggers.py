"""Whose clocks can be compared in a day's logs: those that ran at once and recorded one thing."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice

import numpy as np

from ingest.catalogue.channels import ChannelData
from ingest.facts.events import ClockAligned, SessionRecorded
from ingest.morning.clocks import CannotTellError, ClockOffset, LEAST_s, align, of_one_sensor, pairs

TRIED = 4  # pairs of channels that two clocks are compared by
SIGMAS = 2.0  # within which two clocks agree, and channels tell one lag


@dataclass(frozen=True)
class LoggerClock:
    """A clock beside another: `offset` of it, or None and `why` it cannot be told. `session`: of the clock."""

    session: str
    reference: str
    clock: str
    offset: ClockOffset | None
    why: str | None

    @property
    def agrees(self) -> bool:
        """Whether nothing speaks against both clocks being one."""
        one = self.offset
        return one is not None and (
            abs(one.offset_s) <= SIGMAS * one.offset_sd_s and abs(one.drift_ppm) <= SIGMAS * one.drift_sd_ppm
        )

    @property
    def says(self) -> str:
        """ "can2 is 5.02 s late against can1 (±0.58 s) and drifts by +12.3 ppm (±4.0), by n2 and n1"."""
        one = self.offset
        if one is None:
            return f"{self.clock} against {self.reference}: cannot tell: {self.why}"
        within = SIGMAS * one.offset_sd_s
        by = f"by {' and '.join(dict.fromkeys(reversed(one.by)))}"
        if self.agrees:
            return f"{self.clock} and {self.reference} agree within {within:.2g} s, {by}"
        side = "late" if one.offset_s > 0 else "early"
        digits = int(np.clip(-np.floor(np.log10(within)), 0, 3))
        offset = f"{abs(one.offset_s):.{digits}f} s {side} against {self.reference} (±{within:.{digits}f} s)"
        drifts = f" and drifts by {one.drift_ppm:+.1f} ppm (±{SIGMAS * one.drift_sd_ppm:.1f})".replace("-", "−")
        told = drifts if abs(one.drift_ppm) > SIGMAS * one.drift_sd_ppm else ""
        return f"{self.clock} is {offset}{told}, {by}"

    def event(self) -> ClockAligned:
        """The fact of an offset that is told."""
        assert self.offset is not None
        values = vars(self.offset) | {"by": list(self.offset.by)}
        return ClockAligned(session=self.session, says=self.says, **values)


@dataclass(frozen=True, eq=False)
class _Stream:
    """The channels that one clock of a session stamped; `beside`: the one that stamped them where they count, of a log
    that holds them a second time."""

    session: SessionRecorded
    clock: str
    channels: Sequence[ChannelData]
    beside: str | None = None

    @property
    def span(self) -> tuple[int, int]:
        t = [one.t_ns for one in self.channels]
        return min(int(one[0]) for one in t), max(int(one[-1]) for one in t)


def compared(
    sessions: Sequence[tuple[SessionRecorded, Sequence[ChannelData]]], name_of: Callable[[str], str]
) -> list[LoggerClock]:
    """Each clock beside that of the largest number of channels that ran at once with it; the clock of a log that holds
    channels a second time beside the one that stamped those that count. `name_of`: SHA-256 -> the log's name."""
    streams = [stream for session, channels in sessions for stream in _streams(session, channels, name_of)]
    streams.sort(key=lambda one: -len(one.channels))
    found = []
    for i, one in enumerate(streams):
        reference = next((other for other in streams[:i] if _at_once(other, one)), None)
        if reference is not None:
            found.append(_beside(reference, one))
    return found


def _streams(
    session: SessionRecorded, channels: Sequence[ChannelData], name_of: Callable[[str], str]
) -> Iterator[_Stream]:
    by_clock: dict[tuple[str, str | None], list[ChannelData]] = {}
    for one in channels:
        second = _second(one)
        own = one.samples(~np.isin(one.raw, [*second]))  # what others fill of its gaps would only go with itself
        if len(own.t_ns) > 1 and one.buses and one.spec.role != "ignored" and one.spec.value is None:
            first = one.buses[own.raw[0]]
            by_clock.setdefault((first, None), []).append(own)
            for raw, log in second.items():
                clock = one.buses[raw] if one.buses[raw] != first else f"{first} of {name_of(one.raws[raw])}"
                by_clock.setdefault((clock, first), []).append(log)
    for (clock, beside), some in by_clock.items():
        yield _Stream(session, clock, some, beside)


def _second(channel: ChannelData) -> dict[int, ChannelData]:
    """What other logs, by their number in `raws`, hold of a channel beside it for long enough to be compared."""
    beside = channel.beside
    logs = {} if beside is None else {raw: beside.samples(beside.raw == raw) for raw in np.unique(beside.raw).tolist()}
    return {raw: log for raw, log in logs.items() if (log.t_ns[-1] - log.t_ns[0]) / 1e9 >= LEAST_s}


def _at_once(one: _Stream, other: _Stream) -> bool:
    same = one.session.session == other.session.session
    if one.beside or (other.beside and not (same and other.beside == one.clock)):
        return False
    if not same and not (one.session.absolute and other.session.absolute):
        return False
    (a, b), (c, d) = one.span, other.span
    return (min(b, d) - max(a, c)) / 1e9 >= LEAST_s


def _beside(reference: _Stream, one: _Stream) -> LoggerClock:
    names = _called(reference, one), _called(one, reference)
    told, why = [], "no two of their channels measure the same"
    of_both = of_one_sensor(reference.channels, one.channels) if one.beside else pairs(reference.channels, one.channels)
    for x, y in islice(of_both, TRIED):
        try:
            told.append(align(x, y, names))
        except CannotTellError as error:
            why = f"{x.spec.name} and {y.spec.name}: {error}"
    best = min(told, key=lambda offset: (offset.offset_sd_s, offset.drift_sd_ppm), default=None)
    for other in told:
        assert best is not None
        apart = abs(other.offset_s - best.offset_s)
        if apart > 2 * SIGMAS * float(np.hypot(other.offset_sd_s, best.offset_sd_s)):
            why = f"{best.by[1]} tells {best.offset_s:.2f} s, and {other.by[1]} {other.offset_s:.2f} s"
            best = None
            break
    return LoggerClock(one.session.session, *names, best, None if best else why)


def _called(one: _Stream, other: _Stream) -> str:
    """A clock by its bus or table, with its session where the other is of another one and called alike."""
    alike = one.clock == other.clock
    return f"{one.session.name} {one.clock}" if alike else one.clock
