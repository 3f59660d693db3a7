"""What a specimen went through before each of its checks: sessions in order, and hours at each temperature."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from ingest.catalogue.channels import ChannelData
from ingest.facts.events import SessionRecorded
from ingest.facts.sessions import natural

Floats = NDArray[np.float64]

HEATED = "ageing"
CHECKED = "dc_check"


@dataclass(frozen=True)
class HoursByTemperature:
    """Hours of a session by the temperature [degC] of the hottest place of the specimen, arrays (N,)."""

    degC: Floats
    hours: Floats


@dataclass(frozen=True)
class Trace:
    """The temperature [degC] of the hottest place of the specimen over a session, `t_ns` (N,) rising, and the
    `channel` that shows it."""

    t_ns: NDArray[np.int64]
    degC: Floats
    channel: str

    def until(self, end_ns: int) -> Self:
        """The part before `end_ns`."""
        end = int(np.searchsorted(self.t_ns, end_ns))
        return replace(self, t_ns=self.t_ns[:end], degC=self.degC[:end])

    @property
    def t_s(self) -> Floats:
        """Seconds (N,) from its first sample on."""
        return np.asarray((self.t_ns - self.t_ns[:1]) / 1e9)

    @cached_property
    def heat(self) -> HoursByTemperature:
        """Its hours by temperature, in steps of 0.1 K."""
        from analytics.insulation.dose.oven_cycle import histogram

        found = histogram(self.t_s, self.degC)
        return HoursByTemperature(found.centres_degC, found.hours)

    def hours_above(self, degC: float) -> float:
        """Hours above `degC` [h], to the crossing of it between two samples."""
        from analytics.insulation.dose.oven_cycle import hours_above

        return hours_above(self.t_s, self.degC, degC)


def hottest(channels: Iterable[ChannelData]) -> ChannelData | None:
    """The copper channel with the highest temperature; without any, the hottest other place of the specimen: never a
    boundary."""
    thermometers = (c for c in channels if c.spec.quantity == "temperature" and c.spec.role == "observed")
    own = [channel for channel in thermometers if channel.spec.region != "boundary" and len(channel.t_ns)]
    copper = [channel for channel in own if channel.spec.region == "copper"]
    return max(copper or own, key=lambda channel: float(channel.value.max()), default=None)


def trace_of_heat(channels: Iterable[ChannelData]) -> Trace | None:
    """The specimen's temperature over a session; None where none is recorded."""
    found = hottest(channels)
    return None if found is None else Trace(found.t_ns, found.value, found.spec.name)


def in_order(sessions: Sequence[SessionRecorded]) -> tuple[list[SessionRecorded], bool]:
    """The sessions of a specimen as they followed each other, and whether their stamps tell it.

    Without absolute time the last number of a name tells it: `oven_3` comes before `dc_3`, unless there is one check
    more than there are oven sessions and both count from the same number: then the first check was the start, and
    `dc_3` comes before `oven_3`.
    """
    if all(session.absolute for session in sessions):
        return sorted(sessions, key=lambda session: (session.start_ns, natural(session.name))), True
    ovens = [_number(session) for session in sessions if session.kind == HEATED]
    checks = [_number(session) for session in sessions if session.kind == CHECKED]
    start_first = bool(ovens and checks) and min(ovens) == min(checks) and len(checks) > len(ovens)
    first = CHECKED if start_first else HEATED
    return sorted(sessions, key=lambda one: (_number(one), one.kind != first, natural(one.name))), False


def _number(session: SessionRecorded) -> int:
    found = re.findall(r"[0-9]+", session.name)
    return int(found[-1]) if found else 0


class Logged(Protocol):
    """Something that a session recorded over its time."""

    def until(self, end_ns: int) -> Self:
        """The part before `end_ns`."""


Log = TypeVar("Log", bound=Logged)


def doses(
    sessions: Sequence[SessionRecorded],
    by_time: bool,
    logs: Mapping[str, Log | None],
    worth: Callable[[Log], Floats],
    nothing: Floats,
) -> Mapping[str, Floats | None]:
    """Session -> what the specimen had behind it when it began, (K,) as `worth` counts from `nothing` (K,) on.

    `sessions` in order, `by_time` as `in_order` says. `logs`: None where it is not known what happened to the
    specimen in a session, and then what was behind it is None in all later ones; a session without an entry counts
    nothing. A log that goes on while the specimen is out for its checks counts up to each check.
    """
    whole = {name: worth(log) for name, log in logs.items() if log is not None}
    found: dict[str, Floats | None] = {}
    behind = nothing
    for i, session in enumerate(sessions):
        total: Floats | None = nothing
        for before in sessions[:i]:
            if total is None or before.session not in logs:
                continue
            log = logs[before.session]
            if log is None:
                total = None
            elif by_time and before.end_ns > session.start_ns:
                total = total + worth(log.until(session.start_ns))
            else:
                total = total + whole[before.session]
        if total is not None:
            total = behind = np.maximum(total, behind)  # a log in two parts may count less by its last digit
        found[session.session] = total
    return found
