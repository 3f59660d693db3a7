"""Hours of discharge: how long a test voltage was above the inception voltage that the specimen was last checked for.

A bench file says both with quantities that it has: an oven log a channel of `voltage`, an electrical check
`inception_voltage`. Both are taken as rms, as an alternating test voltage is stated (IEC 60270: peak over root 2).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ingest.catalogue.channels import ChannelData
from ingest.facts.events import SessionRecorded
from replay.engine.specimen.heat_history import HEATED, doses

Floats = NDArray[np.float64]

VOLTAGE, INCEPTION = "voltage", "inception_voltage"
APART_NS = 3_600_000_000_000  # values further from each other are of two checks, as in the view insulation_checks
NO_GAP_V = 327.0 / math.sqrt(2.0)  # Paschen's minimum of air is 327 V: below it no gap in air discharges, however wide


@dataclass(frozen=True)
class AppliedVoltage:
    """The voltage [V] of a session, `t_ns` (N,) rising, and the specimen's inception voltage [V] then."""

    t_ns: NDArray[np.int64]
    volts: Floats
    inception_V: float

    def until(self, end_ns: int) -> Self:
        """The part before `end_ns`."""
        end = int(np.searchsorted(self.t_ns, end_ns))
        return replace(self, t_ns=self.t_ns[:end], volts=self.volts[:end])

    def hours(self) -> Floats:
        """Hours above the inception voltage (1,) [h]."""
        from analytics.insulation.dose.oven_cycle import hours_above

        return np.array([hours_above((self.t_ns - self.t_ns[:1]) / 1e9, self.volts, self.inception_V)])


@dataclass(frozen=True)
class Electrical:
    """What a session says of voltage. The test voltage of an oven log that could discharge at all: stamps [ns] and
    values [V], of several channels the highest; None where there was none. The inception voltages that it measured:
    when [ns] and how high [V], of several phases the lowest; a table of checks holds several."""

    tested: tuple[NDArray[np.int64], Floats] | None
    inceptions: tuple[tuple[int, float], ...] = ()


@dataclass(frozen=True)
class Discharge:
    """`before`: session -> hours of discharge before it [h], None where they are not known; then `why` says it in a
    line."""

    before: Mapping[str, float | None]
    why: str | None


def electrical_of(session: SessionRecorded, channels: Sequence[ChannelData]) -> Electrical:
    """What a session says of voltage. `channels`: all of the session, the ones that its bench file ignores too."""
    used = [channel for channel in channels if channel.spec.role != "ignored" and len(channel.t_ns)]
    volts = [channel for channel in used if channel.spec.quantity == VOLTAGE and session.kind == HEATED]
    tested = [(one.t_ns, np.abs(one.value)) for one in volts if np.abs(one.value).max() > NO_GAP_V]
    checked = [channel for channel in used if channel.spec.quantity == INCEPTION]
    return Electrical(max(tested, key=lambda one: float(one[1].mean()), default=None), tuple(_inceptions(checked)))


def _inceptions(channels: Sequence[ChannelData]) -> Iterator[tuple[int, float]]:
    """When each check began [ns], and the lowest of its channels' medians [V]."""
    stamps = np.unique(np.concatenate([np.empty(0, np.int64), *(channel.t_ns for channel in channels)]))
    for check in np.split(stamps, 1 + np.flatnonzero(np.diff(stamps) > APART_NS)):
        within = [values for channel in channels if len(values := channel.value[np.isin(channel.t_ns, check)])]
        if within:
            yield int(check[0]), min(float(np.median(values)) for values in within)


def discharge_of(sessions: Sequence[SessionRecorded], by_time: bool, electrical: Mapping[str, Electrical]) -> Discharge:
    """Hours of discharge before each session of a specimen. `sessions` in order, `by_time` as `heat_history.in_order`
    says; those without an entry in `electrical` count nothing."""
    known: list[tuple[int, float]] = []
    tests: dict[str, AppliedVoltage | None] = {}
    for session in sessions:
        said = electrical.get(session.session)
        if said is None:
            continue
        if said.tested is not None:
            before = [volts for t_ns, volts in known if not by_time or t_ns < session.start_ns]
            tests[session.session] = AppliedVoltage(*said.tested, before[-1]) if before else None
        known += said.inceptions
        known.sort(key=lambda one: one[0] if by_time else 0)
    found = doses(sessions, by_time, tests, AppliedVoltage.hours, np.zeros(1))
    hours_before = {name: None if hours is None else float(hours[0]) for name, hours in found.items()}
    unknown = next((session.name for session in sessions if tests.get(session.session, True) is None), None)
    why = (
        f"session {unknown} has a test voltage, and no inception voltage was measured before it: hours of discharge "
        "are not known from there on; ingest the electrical check that came before it (inception_voltage)."
    )
    return Discharge(hours_before, why if unknown is not None else None)
