"""What a specimen went through before each of its checks: its sessions in order, and the hours it spent at each temperature."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ingest.catalogue.channels import ChannelData
from ingest.events import SessionRecorded
from ingest.sessions import natural

Floats = NDArray[np.float64]

HEATED = "ageing"
CHECKED = "dc_check"


@dataclass(frozen=True)
class Heat:
    """Hours of a session by the temperature [degC] of the hottest place of the specimen, arrays (N,)."""

    degC: Floats
    hours: Floats


@dataclass(frozen=True)
class Trace:
    """The temperature [degC] of the hottest place of the specimen over a session, `t_ns` (N,) rising; `channel` that shows it."""

    t_ns: NDArray[np.int64]
    degC: Floats
    channel: str

    def heat(self, until_ns: int | None = None) -> Heat:
        """The hours of the session, of those before `until_ns` where given."""
        from analytics.insulation.oven_cycle import histogram

        end = len(self.t_ns) if until_ns is None else int(np.searchsorted(self.t_ns, until_ns))
        found = histogram((self.t_ns[:end] - self.t_ns[0]) / 1e9, self.degC[:end])
        return Heat(found.centres_degC, found.hours)


def hottest(channels: Iterable[ChannelData]) -> ChannelData | None:
    """The copper channel with the highest temperature; without any, the hottest other place of the specimen: never a boundary."""
    own = [
        channel
        for channel in channels
        if channel.spec.quantity == "temperature"
        and channel.spec.role == "observed"
        and channel.spec.region != "boundary"
        and len(channel.t_ns)
    ]
    copper = [channel for channel in own if channel.spec.region == "copper"]
    return max(copper or own, key=lambda channel: float(channel.value.max()), default=None)


def trace_of_heat(channels: Iterable[ChannelData]) -> Trace | None:
    """The course of a session; None where no temperature of the specimen is recorded."""
    found = hottest(channels)
    return None if found is None else Trace(found.t_ns, found.value, found.spec.name)


def in_order(sessions: Sequence[SessionRecorded]) -> tuple[list[SessionRecorded], bool]:
    """The sessions of a specimen as they followed each other, and whether their stamps tell it.

    Without absolute time the last number of a name tells it: `oven_3` comes before `dc_3`, unless there is one check more than there
    are oven sessions and both count from the same number: then the first check was the start, and `dc_3` comes before `oven_3`.
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


def doses(
    sessions: Sequence[SessionRecorded],
    by_time: bool,
    traces: Mapping[str, Trace | None],
    worth: Callable[[Heat], Floats],
) -> Mapping[str, Floats | None]:
    """Session -> what the specimen had behind it, (K,) as `worth` counts; None behind an oven session without temperatures.

    `sessions` in order, `by_time` as `in_order` says. An oven log that goes on while the specimen is out for its checks
    counts up to each check.
    """
    whole = {name: worth(trace.heat()) for name, trace in traces.items() if trace is not None}
    none = worth(Heat(np.empty(0), np.empty(0)))
    found: dict[str, Floats | None] = {}
    for i, session in enumerate(sessions):
        total: Floats | None = none
        for before in sessions[:i]:
            trace = traces.get(before.session)
            if trace is None:
                total = None if before.kind == HEATED else total
            elif total is not None:
                overlaps = by_time and before.end_ns > session.start_ns
                total = total + (worth(trace.heat(session.start_ns)) if overlaps else whole[before.session])
        found[session.session] = total
    return found
