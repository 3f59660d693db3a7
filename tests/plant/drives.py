"""What the bench asks of the motor: a drive is a course of speed, torque, flow and surroundings at a fixed rate."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

TRACE = Path(__file__).parents[2] / "ingest" / "catalogue" / "wltc_class3b.txt"
RATE_HZ = 10.0
INLET_degC, AMBIENT_degC, FLOW_lpm = 65.0, 25.0, 10.0
OVEN_degC, OVEN_s = 230.0, 12 * 3600.0
DC_A = 160.0


@dataclass(frozen=True)
class Drive:
    """Samples (M,) at `rate_hz`: speed [rpm], torque asked for [Nm], flow [l/min], inlet and ambient [degC];
    `inverter` 0 where it is off; `direct` [A peak] a d current instead of a torque, 0 elsewhere. `step_s` of the
    solver."""

    name: str
    kind: str
    speed_rpm: Floats
    torque_Nm: Floats
    flow_lpm: Floats
    inlet_degC: Floats
    ambient_degC: Floats
    inverter: Floats
    direct_A: Floats
    rate_hz: float = RATE_HZ
    step_s: float = 0.5

    @property
    def samples(self) -> int:
        """M."""
        return len(self.speed_rpm)

    @property
    def seconds(self) -> float:
        """Its length [s]."""
        return self.samples / self.rate_hz

    def with_courses(self, courses: dict[str, Floats]) -> Drive:
        """The same drive with other courses."""
        changed: dict[str, Any] = dict(courses)
        return replace(self, **changed)

    def first(self, seconds: float) -> Drive:
        """The first so many seconds, or all where it is shorter."""
        m = self.samples if seconds >= self.seconds else round(seconds * self.rate_hz)
        return self.with_courses({name: getattr(self, name)[:m] for name in COURSES})


COURSES = ("speed_rpm", "torque_Nm", "flow_lpm", "inlet_degC", "ambient_degC", "inverter", "direct_A")


def drive(
    name: str,
    kind: str,
    speed_rpm: Floats,
    torque_Nm: Floats,
    flow_lpm: float | Floats = FLOW_lpm,
    rate_hz: float = RATE_HZ,
) -> Drive:
    """A drive with the usual surroundings: the inlet wanders by 0.4 K with its controller, the room by 0.5 K."""
    m = len(speed_rpm)
    t = np.arange(m) / rate_hz
    ones = np.ones(m)
    inlet = INLET_degC + 0.4 * np.sin(2 * np.pi * t / 410.0)
    ambient = AMBIENT_degC + 0.5 * np.sin(2 * np.pi * t / 2900.0)
    return Drive(name, kind, speed_rpm, torque_Nm, flow_lpm * ones, inlet, ambient, ones, 0.0 * ones, rate_hz)


def join(name: str, kind: str, parts: list[Drive]) -> Drive:
    """The parts one after the other, as one drive."""
    courses = {c: np.concatenate([getattr(part, c) for part in parts]) for c in COURSES}
    return replace(parts[0].with_courses(courses), name=name, kind=kind)


def ramp(from_: float, to: float, seconds: float) -> Floats:
    """A course from one value to another."""
    return np.linspace(from_, to, round(seconds * RATE_HZ), endpoint=False)


def flat(value: float, seconds: float) -> Floats:
    """A course that stays."""
    return np.full(round(seconds * RATE_HZ), value)


# ---- a vehicle on the WLTC -----------------------------------------------------------------------------------------


@cache
def wltc() -> Floats:
    """Speed of the WLTC class 3b [km/h] each second, (1801,); UN GTR 15, Annex 1."""
    lines = TRACE.read_text("ascii").splitlines()
    return np.array([float(word) for line in lines if not line.startswith("#") for word in line.split()])


@dataclass(frozen=True)
class Vehicle:
    """Mass [kg], road load [N, N/(m/s), N/(m/s)2], wheel radius [m], ratio of the single gear, its efficiency; torque
    [Nm] at which it brakes and pulls at most."""

    mass: float = 3000.0
    road: tuple[float, float, float] = (260.0, 1.5, 0.72)
    radius: float = 0.335
    ratio: float = 12.2
    efficiency: float = 0.97
    torque: tuple[float, float] = (-120.0, 220.0)


def wltp(cycles: int = 3, vehicle: Vehicle | None = None, name: str = "wltp", trailer: float = 1.0) -> Drive:
    """`cycles` WLTC one after the other and half a minute of standing; `trailer` multiplies mass and road load."""
    car = vehicle or Vehicle()
    trace = np.concatenate([*[wltc()[:-1]] * cycles, np.zeros(30)])
    t = np.arange(trace.size * int(RATE_HZ)) / RATE_HZ
    speed = np.interp(t, np.arange(trace.size), trace) / 3.6
    speed = np.convolve(np.pad(speed, 5, mode="edge"), np.full(11, 1 / 11), "valid")  # a driver smooths by a second
    accelerates = np.gradient(speed, 1 / RATE_HZ)
    f0, f1, f2 = car.road
    moving = speed > 0.3
    force = trailer * (car.mass * 1.03 * accelerates + moving * (f0 + f1 * speed + f2 * speed**2))
    wheel = force * car.radius / car.ratio
    torque = np.clip(np.where(wheel > 0, wheel / car.efficiency, wheel * car.efficiency), *car.torque)
    rpm = speed / car.radius * car.ratio * 30 / np.pi
    return drive(name, "wltp", rpm, torque)


# ---- bench points --------------------------------------------------------------------------------------------------


def hold(speed_rpm: float, torque_Nm: float, minutes: float, name: str = "s1", kind: str = "s1") -> Drive:
    """Run up, hold speed and torque, stop."""
    seconds = 60.0 * minutes
    up, down = 8.0, 10.0
    speed = np.concatenate([ramp(0, speed_rpm, up), flat(speed_rpm, seconds - up - down), ramp(speed_rpm, 0, down)])
    torque = np.concatenate([flat(0, up), flat(torque_Nm, seconds - up - down), flat(0, down)])
    return drive(name, kind, speed, torque)


def pulse(speed_rpm: float, torque_Nm: float, seconds: float, rest_s: float, rest_Nm: float = 8.0) -> Drive:
    """One pulse of load and the rest after it, at constant speed; torque rises within 0.2 s."""
    torque = np.concatenate([flat(torque_Nm, seconds), flat(rest_Nm, rest_s)])
    torque[:2] = torque_Nm * np.array([1 / 3, 2 / 3])[: len(torque[:2])]
    return drive("pulse", "s2", flat(speed_rpm, seconds + rest_s), torque)


def spin_down(top_rpm: float = 9_000.0, times: int = 3, coast_s: float = 110.0, name: str = "spin_down") -> Drive:
    """No load: up to speed, two minutes there, coast with the inverter off, a minute of rest. Drag ~ speed and its
    square. Up to 9,000 rpm the magnets' voltage stays below the link's, so that no current flows through the
    inverter's diodes."""
    t = np.arange(round(coast_s * RATE_HZ)) / RATE_HZ
    coast = top_rpm * (np.exp(-2.5 * t / coast_s) - np.exp(-2.5)) / (1 - np.exp(-2.5))
    one = np.concatenate([ramp(0, top_rpm, 15.0), flat(top_rpm, 120.0), coast, flat(0.0, 60.0)])
    on = np.concatenate([flat(1, 135.0), flat(0, coast_s + 60.0)])
    speed = np.tile(one, times)
    return replace(drive(name, "drive", speed, np.zeros_like(speed)), inverter=np.tile(on, times))


def dc_check(minutes: float = 40.0, current_A: float = DC_A, name: str = "dc_check") -> Drive:
    """Direct current through two phases at standstill: I, -I, 0 is a space vector of 2 / sqrt(3) I; losses 2 R I^2."""
    seconds = 60.0 * minutes
    off = 30.0
    direct = np.concatenate([flat(0, off), flat(2 / np.sqrt(3) * current_A, seconds - off)])
    still = np.zeros(direct.size)
    return replace(drive(name, "dc_check", still, still), direct_A=direct)


def oven(name: str = "ageing", seconds: float = OVEN_s, degC: float = OVEN_degC) -> Drive:
    """The whole motor, dry and without current, in an oven: half an hour up, half an hour down."""
    rate, step = 0.2, 10.0
    t = np.arange(round((seconds + 3600.0) * rate)) / rate
    shape = np.clip(np.minimum(t / 1800.0, (seconds + 3600.0 - t) / 1800.0), 0.0, 1.0)
    ambient = AMBIENT_degC + (degC - AMBIENT_degC) * shape
    still = np.zeros(t.size)
    dry = drive(name, "ageing", still, still, 0.0, rate)
    return replace(dry, ambient_degC=ambient, inlet_degC=ambient, inverter=still, step_s=step)


def flow_step(speed_rpm: float, torque_Nm: float, minutes: float = 40.0, name: str = "flow_step") -> Drive:
    """A held point with the flow at 10, 5, 10 and 14 l/min in turn."""
    base = hold(speed_rpm, torque_Nm, minutes, name)
    levels = np.array([10.0, 5.0, 10.0, 14.0])
    return replace(base, flow_lpm=levels[np.arange(base.samples) * 4 // base.samples])
