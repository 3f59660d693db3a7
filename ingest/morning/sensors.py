"""Sensors to look at: silent, dead, held, saturated, off their neighbours at rest, jumping together, exchanged,
drifted.

What a channel says alone is judged by the rules of `ingest.catalogue.quality`. Beside that

- a channel is silent where the log knows it and it has no value at all,
- a thermometer is dead where it stays at one value for the whole session while others move, or reads what no bench
  has, as an open thermocouple does,
- at rest before the load, where the motor and what surrounds it are at one temperature, all thermometers of the motor
  must agree: one that is off more than twice its uncertainty disagrees with its neighbours. Where they are not at one
  temperature nothing is said.

What differs from the last run of the test is told by `differences`: here, whether two sensors were exchanged, and
whether one is off by the same at every temperature, which a sensor is and a motor is not.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ingest.catalogue.channels import ChannelData, current, find
from ingest.catalogue.kinds import CURRENT_A, STANDSTILL_rpm
from ingest.catalogue.quality import OF_NO_SENSOR, ChannelQuality, findings, seconds, without_value
from ingest.morning.differences import BIAS_K, ChannelDifference, is_around
from ingest.morning.jumps import jumps_together
from ingest.texts.times import clock

POSSIBLE_degC = (-80.0, 600.0)  # colder and hotter than any bench and its winding
WHOLE = 0.9  # of a session: who stays for so long at one value never told anything
REST_s = 60.0
AT_REST_K = 1.5  # within which most thermometers are at one temperature
AGREE = 2 / 3  # of the thermometers, and three at least
SIGMAS = 4.0  # of a sensor's uncertainty, from which it disagrees
EXCHANGED = 0.25  # of what two channels differ by, what is left of it once they are exchanged


@dataclass(frozen=True)
class SensorFault:
    """`fault`: silent, dead, held, stuck, saturated, disagrees, jumps, swapped or drifted; `says`: a line that names
    it. Of several channels (jumps, swapped) `channel` has all their names."""

    channel: str
    fault: str
    says: str


def alone(
    channels: Sequence[ChannelData], qualities: Sequence[ChannelQuality], known: Sequence[str]
) -> list[SensorFault]:
    """What the channels of a session say by themselves. `known`: names of those that its logs hold."""
    there = {one.spec.name for one in channels if len(one.t_ns)}
    silent = [SensorFault(name, "silent", without_value(name)) for name in known if name not in there]
    dead = {one.channel: one for one in _dead(channels, qualities)}
    flagged = [
        SensorFault(flag.detail["channel"], flag.flag, flag.says)
        for flag in findings(qualities)
        if flag.flag not in OF_NO_SENSOR and flag.detail["channel"] not in dead
    ]
    return [*silent, *dead.values(), *flagged, *_off_neighbours(channels, dead)]


def _dead(channels: Sequence[ChannelData], qualities: Sequence[ChannelQuality]) -> Iterator[SensorFault]:
    for one, seen in zip(channels, qualities, strict=True):
        if one.spec.quantity != "temperature" or one.spec.role == "ignored" or not len(one.t_ns):
            continue
        name, span_s = one.spec.name, (one.t_ns[-1] - one.t_ns[0]) / 1e9
        middle = float(np.median(one.value))
        if not POSSIBLE_degC[0] <= middle <= POSSIBLE_degC[1]:
            yield SensorFault(name, "dead", f"{name} reads {middle:,.0f} °C most of the time: open, or not connected")
        elif span_s > 0 and sum(lapse.duration_s for lapse in seen.stretches) > WHOLE * span_s:
            yield SensorFault(name, "dead", f"{name} stays at {middle:,.5g} °C for {seconds(span_s)} while others move")


def _off_neighbours(channels: Sequence[ChannelData], dead: Mapping[str, SensorFault]) -> Iterator[SensorFault]:
    """Thermometers of the motor that read another temperature than the others while all is at rest."""
    resting = _at_rest(channels)
    if resting is None:
        return
    thermometers = {one.spec.name: one for one in channels if _is_thermometer(one) and one.spec.name not in dead}
    read = {name: value for name, one in thermometers.items() if (value := _first(one, resting)) is not None}
    motor = {name: value for name, value in read.items() if not is_around(thermometers[name])}
    around = [value for name, value in read.items() if name not in motor]
    if len(motor) < 3:
        return
    middle = float(np.median(list(motor.values())))
    agree = sum(abs(value - middle) <= AT_REST_K for value in motor.values())
    if agree < max(3, AGREE * len(motor)) or any(abs(value - middle) > 2 * AT_REST_K for value in around):
        return
    for name, value in motor.items():
        off = value - middle
        if abs(off) > SIGMAS * (thermometers[name].spec.bias_sd or BIAS_K):
            side = "more" if off > 0 else "less"
            says = f"{name} reads {abs(off):.1f} K {side} than {agree} others at rest ({middle:.1f} °C)"
            yield SensorFault(name, "disagrees", says)


def _is_thermometer(one: ChannelData) -> bool:
    return one.spec.quantity == "temperature" and one.spec.role != "ignored" and len(one.t_ns) > 0


def _at_rest(channels: Sequence[ChannelData]) -> tuple[int, int] | None:
    """The first REST_s of a session [ns], where it neither turned nor was loaded then; None where nobody knows."""
    speed, load = find(channels, "speed"), current(channels) or find(channels, "torque")
    drives = [(one, least) for one, least in ((speed, STANDSTILL_rpm), (load, CURRENT_A)) if one is not None]
    if load is None:
        return None
    begin = max(int(one.t_ns[0]) for one, _ in drives)
    end = begin + int(REST_s * 1e9)
    for one, least in drives:
        inside = one.value[(one.t_ns >= begin) & (one.t_ns < end)]
        if not len(inside) or np.abs(inside).max() > least:
            return None
    return begin, end


def _first(one: ChannelData, span: tuple[int, int]) -> float | None:
    inside = one.value[(one.t_ns >= span[0]) & (one.t_ns < span[1])]
    return float(inside.mean()) if len(inside) and np.ptp(inside) < 2 * AT_REST_K else None


def jumping(channels: Sequence[ChannelData]) -> list[SensorFault]:
    """Thermometers of the motor that jump together, the ignored ones too: their wires pick up the same. `channels`:
    those of a session without what told nothing new."""
    wired = [one for one in channels if one.spec.quantity == "temperature" and not one.spec.derived]
    found = jumps_together([one for one in wired if not is_around(one)], channels)
    if found is None:
        return []
    jumps, names = len(found.at_s), ", ".join(found.channels)
    sizes = " to ".join(dict.fromkeys(f"{size:.1f}" for size in (found.size_K.min(), found.size_K.max())))
    standing = f", {found.standing} of them while the motor stands" if found.standing else ""
    at = clock(found.at_s[0])
    says = (
        f"{len(found.channels)} thermometers jump together by {sizes} K (jumps: {jumps}{standing}; the first at {at}):"
        f" heat cannot do that, but an inverter, a ground or an amplifier can ({names})"
    )
    return [SensorFault(names, "jumps", says)]


def since_before(found: Sequence[ChannelDifference], before: str) -> list[SensorFault]:
    """Which sensors were exchanged since the run `before`, and which are off by the same at every temperature."""
    off = [one for one in found if one.verdict == "exceeds" and one.quantity == "temperature" and not one.around]
    told = list(_swapped(off, before))
    pairs = {name for one in told for name in one.channel.split(" and ")}
    for one in off:
        if one.constant and one.channel not in pairs:
            side = "more" if one.difference > 0 else "less"
            says = f"{one.channel} reads {abs(one.difference):.1f} K {side} than in {before}, cold as well as warm"
            told.append(SensorFault(one.channel, "drifted", says))
    return told


def _swapped(off: Sequence[ChannelDifference], before: str) -> Iterator[SensorFault]:
    for i, one in enumerate(off):
        for other in off[i + 1 :]:
            apart = abs(one.second - one.first) + abs(other.second - other.first)
            crossed = abs(one.second - other.first) + abs(other.second - one.first)
            if crossed < EXCHANGED * apart:
                names = " and ".join(sorted((one.channel, other.channel)))
                yield SensorFault(names, "swapped", f"{names} read as each other did in {before}: exchanged")
