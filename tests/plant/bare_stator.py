"""A bare hairpin stator on glass-fibre supports in free air, heated by direct current through two of its three phases.

Twenty-four lumps: slot halves, and near and far part of both winding heads, of each phase; teeth and yoke in halves;
the supports; the air in the bore. Many stators and checks are run together as arrays (B, lumps). Heat leaves by
radiation and free convection; between copper and iron lies the slot insulation, whose resistance a campaign changes.

A stator of 198 mm x 134 mm with 48 slots, six bars of 7.6 mm2 each, three parallel paths: 6.0 mOhm per phase at 20
degC. No real one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

PHASES, ENDS = "uvw", "ab"
LUMPS = (
    *(f"{part}_{phase}{end}" for part in ("slot", "near", "crown") for end in ENDS for phase in PHASES),
    *(f"{part}_{end}" for part in ("teeth", "yoke") for end in ENDS),
    *("support", "bore_air"),
)
INDEX = {name: place for place, name in enumerate(LUMPS)}
COPPER = np.arange(18)
BORE_AIR = INDEX["bore_air"]
STEFAN_BOLTZMANN = 5.670374419e-8  # W/(m2 K4)
ALPHA_per_K, REFERENCE_degC = 0.00393, 20.0
PHASE_ohm = 6.0e-3  # at 20 degC
LENGTH_SHARES = {"slot": 0.22, "near": 0.11, "crown": 0.17}  # of a phase's copper, at each end
FILMS = ("quarter", "churchill", "third")
GAMMA = 1.0 - 1.0 / np.sqrt(2.0)
RENEWED = 12  # steps between two Jacobians; the method is of order 2 with any


@dataclass(frozen=True)
class Rig:
    """What stays the same from check to check. `film`: form of free convection, one of FILMS."""

    energised: str = "uv"
    current_A: float = 160.0
    heating_s: float = 3.0 * 3600
    cooling_s: float = 3600.0
    film: str = "quarter"
    film_factor: float = 1.3
    leads_ohm: float = 1.5e-3  # between the tap of the voltmeter and the winding, at any temperature
    step_s: float = 5.0


@dataclass(frozen=True)
class Stators:
    """B stators, each at one check. Factors of the design: `insulation` of the slots' resistance, `conduction` of all
    other joints (B, joints), `capacity` (B, lumps), `copper` of the winding's resistance. Emissivities of winding
    heads and iron."""

    insulation: Floats
    head_emissivity: Floats
    iron_emissivity: Floats
    conduction: Floats
    capacity: Floats
    copper: Floats

    @property
    def size(self) -> int:
        """B."""
        return len(self.insulation)


@dataclass(frozen=True)
class Run:
    """A check as it went: `t_s` (N,); `temperature` (N, B, lumps) [degC]; `heat` in the copper (N, B) [W]; `current`
    (N,) [A]."""

    t_s: Floats
    temperature: Floats
    heat: Floats
    current: Floats
    energy_in_J: Floats  # into the copper, (B,)
    energy_out_J: Floats  # to the room, (B,)


@dataclass(frozen=True)
class _Joint:
    a: int
    b: int
    W_per_K: float
    insulates: bool = False


def _joints() -> tuple[_Joint, ...]:
    found = []

    def join(a: str, b: str, conductance: float, insulates: bool = False) -> None:
        found.append(_Joint(INDEX[a], INDEX[b], conductance, insulates))

    for phase in PHASES:
        join(f"slot_{phase}a", f"slot_{phase}b", 4.3)
        for end in ENDS:
            here = f"{phase}{end}"
            join(f"slot_{here}", f"near_{here}", 6.5)
            join(f"near_{here}", f"crown_{here}", 6.0)
            join(f"slot_{here}", f"teeth_{end}", 3.8, insulates=True)
            join(f"slot_{here}", f"yoke_{end}", 0.75, insulates=True)
            join(f"near_{here}", f"yoke_{end}", 0.15)
    for end in ENDS:
        for one, other in ("uv", "vw", "wu"):
            join(f"near_{one}{end}", f"near_{other}{end}", 0.9)
            join(f"crown_{one}{end}", f"crown_{other}{end}", 0.5)
        join(f"teeth_{end}", f"yoke_{end}", 24.0)
    join("teeth_a", "teeth_b", 0.5)
    join("yoke_a", "yoke_b", 0.6)
    join("yoke_b", "support", 0.8)
    return tuple(found)


JOINTS = _joints()
# In the order of LUMPS: J/K, resin included; m2 towards the room and towards the air in the bore; m2 times view
# factor of the room.
CAPACITY = np.repeat([170.0, 100.0, 150.0, 1100.0, 2250.0, 700.0, 20.0], [6, 6, 6, 2, 2, 1, 1])
ROOM_m2 = np.repeat([0.0, 0.006, 0.013, 0.0, 0.054, 0.05, 0.0], [6, 6, 6, 2, 2, 1, 1])
BORE_m2 = np.repeat([0.0, 0.003, 0.004, 0.0276, 0.0, 0.0, 0.0], [6, 6, 6, 2, 2, 1, 1])
SEES_ROOM = np.repeat([0.0, 0.0055, 0.0125, 0.008, 0.054, 0.03, 0.0], [6, 6, 6, 2, 2, 1, 1])
FILM_OF = np.ones(len(LUMPS))
FILM_OF[INDEX["crown_va"]] = 0.7  # jumpers and resin lie over it: there sits the hottest sensor
HEADS = np.array([name.startswith(("near", "crown")) for name in LUMPS])
CHIMNEY_W_per_K15 = 0.11  # flow through the bore grows with the root of its excess
SUPPORT_EMISSIVITY = 0.9


def designed(size: int) -> Stators:
    """`size` stators as drawn, new."""
    one = np.ones(size)
    return Stators(one, 0.80 * one, 0.80 * one, np.ones((size, len(JOINTS))), np.ones((size, len(LUMPS))), one)


def film_W_per_m2K(film: str, excess_K: Floats, air_degC: Floats) -> Floats:
    """Free convection at a cylinder of 0.2 m. `churchill`: Churchill and Chu, DOI 10.1016/0017-9310(75)90222-7,
    laminar form, with properties of air at the mean temperature. Raises KeyError for a form that is none."""
    dT = np.abs(excess_K) + 0.01
    if film == "quarter":
        return np.asarray(1.98 * dT**0.25)
    if film == "third":
        return np.asarray(1.24 * dT ** (1.0 / 3.0))
    if film != "churchill":
        raise KeyError(film)
    kelvin = air_degC + excess_K / 2.0 + 273.15
    ratio = kelvin / 293.15
    conductivity, viscosity = 0.0257 * ratio**0.82, 1.51e-5 * ratio**1.72
    rayleigh = 9.81 / kelvin * dT * 0.198**3 / viscosity**2 * 0.71
    nusselt = 0.36 + 0.518 * rayleigh**0.25 / (1.0 + (0.559 / 0.71) ** (9.0 / 16.0)) ** (4.0 / 9.0)
    return np.asarray(conductivity / 0.198 * nusselt)


class _System:
    """Heat balances of B stators: C dT/dt = f(T)."""

    def __init__(self, stators: Stators, rig: Rig) -> None:
        count, lumps = stators.size, len(LUMPS)
        self.rig = rig
        self.capacity = CAPACITY * stators.capacity
        self.laplace = np.zeros((count, lumps, lumps))
        for place, joint in enumerate(JOINTS):
            g = joint.W_per_K * (1.0 / stators.insulation if joint.insulates else stators.conduction[:, place])
            self.laplace[:, joint.a, joint.a] += g
            self.laplace[:, joint.b, joint.b] += g
            self.laplace[:, joint.a, joint.b] -= g
            self.laplace[:, joint.b, joint.a] -= g
        emissivity = np.where(HEADS, stators.head_emissivity[:, None], stators.iron_emissivity[:, None])
        emissivity[:, INDEX["support"]] = SUPPORT_EMISSIVITY
        self.radiates = STEFAN_BOLTZMANN * SEES_ROOM * emissivity
        self.cold_ohm = np.zeros((count, lumps))
        for name, place in INDEX.items():
            part, _, where = name.partition("_")
            if part in LENGTH_SHARES and where[0] in rig.energised:
                self.cold_ohm[:, place] = PHASE_ohm * LENGTH_SHARES[part] * stators.copper

    def heat(self, temperature: Floats, current: float) -> Floats:
        """Heat in each lump (B, lumps) [W] with a current [A]."""
        return current**2 * self.cold_ohm * (1.0 + ALPHA_per_K * (temperature - REFERENCE_degC))

    def films(self, temperature: Floats, air: Floats) -> tuple[Floats, Floats, Floats]:
        """Film conductances [W/K] of each lump to the room's air and to the bore's, and of the bore's air to the
        room's."""
        rig = self.rig
        bore = temperature[:, BORE_AIR, None]
        to_room = rig.film_factor * ROOM_m2 * FILM_OF * film_W_per_m2K(rig.film, temperature - air, air)
        to_bore = rig.film_factor * BORE_m2 * 0.8 * film_W_per_m2K(rig.film, temperature - bore, bore)
        return to_room, to_bore, CHIMNEY_W_per_K15 * np.sqrt(np.abs(bore - air) + 0.01)

    def balance(self, temperature: Floats, air_degC: Floats, current: float) -> tuple[Floats, Floats]:
        """Heat into each lump (B, lumps) [W], and from each stator to the room (B,) [W]; ambient `air_degC` (B,)."""
        air = air_degC[:, None]
        bore = temperature[:, BORE_AIR, None]
        to_room, to_bore, chimney = self.films(temperature, air)
        lost = to_room * (temperature - air)
        lost += self.radiates * ((temperature + 273.15) ** 4 - (air + 273.15) ** 4)
        lost[:, BORE_AIR] += (chimney * (bore - air))[:, 0]
        into_bore = to_bore * (temperature - bore)
        net = self.heat(temperature, current) - lost - into_bore
        net[:, BORE_AIR] += into_bore.sum(axis=1)
        return net - np.einsum("bij,bj->bi", self.laplace, temperature), lost.sum(axis=1)

    def jacobian(self, temperature: Floats, air_degC: Floats, current: float) -> Floats:
        """d balance / d temperature (B, lumps, lumps), without the slopes of the films."""
        to_room, to_bore, chimney = self.films(temperature, air_degC[:, None])
        matrix = -self.laplace.copy()
        own = current**2 * self.cold_ohm * ALPHA_per_K - to_room - to_bore
        own -= 4.0 * self.radiates * (temperature + 273.15) ** 3
        own[:, BORE_AIR] -= to_bore.sum(axis=1) + chimney[:, 0]
        diagonal = np.arange(len(LUMPS))
        matrix[:, diagonal, diagonal] += own
        matrix[:, :, BORE_AIR] += to_bore
        matrix[:, BORE_AIR, :] += to_bore
        return matrix


def run(stators: Stators, rig: Rig, start_degC: Floats, ambient_degC: Floats) -> Run:
    """Heat, then cool. `start_degC` (B, lumps); `ambient_degC` (N + 1, B) at every step of the rig.

    ROS2, a two-stage Rosenbrock method of order 2, L-stable, with inexact Jacobians: Verwer, Spee, Blom and
    Hundsdorfer, DOI 10.1137/S1064827597326651.
    """
    system, h = _System(stators, rig), rig.step_s
    steps = round((rig.heating_s + rig.cooling_s) / h)
    heated = round(rig.heating_s / h)
    course = np.empty((steps + 1, stators.size, len(LUMPS)))
    heat, lost = np.empty((2, steps + 1, stators.size))
    course[0] = start_degC
    current = np.where(np.arange(steps + 1) < heated, rig.current_A, 0.0)
    into = np.zeros(stators.size)
    inverse = np.empty(0)
    for k in range(steps):
        here, amps = course[k], float(current[k])
        if k % RENEWED == 0 or k == heated:
            matrix = -GAMMA * h * system.jacobian(here, ambient_degC[k], amps)
            matrix[:, np.arange(len(LUMPS)), np.arange(len(LUMPS))] += system.capacity
            inverse = np.linalg.inv(matrix)
        net, lost[k] = system.balance(here, ambient_degC[k], amps)
        first = np.einsum("bij,bj->bi", inverse, net)
        ahead, _ = system.balance(here + h * first, ambient_degC[k + 1], amps)
        second = np.einsum("bij,bj->bi", inverse, ahead - 2.0 * system.capacity * first)
        course[k + 1] = here + h * (1.5 * first + 0.5 * second)
        heat[k] = system.heat(here, amps).sum(axis=1)
        into += h * (heat[k] + system.heat(course[k + 1], amps).sum(axis=1)) / 2.0
    heat[steps], lost[steps] = 0.0, system.balance(course[steps], ambient_degC[steps], 0.0)[1]
    t_s = np.arange(steps + 1, dtype=np.float64) * h
    return Run(t_s, course, heat, current, into, h * (lost.sum(axis=0) - (lost[0] + lost[-1]) / 2.0))


def steady(stators: Stators, rig: Rig, ambient_degC: Floats) -> tuple[Floats, Floats, Floats]:
    """Temperatures (B, lumps), heat (B,) and heat lost to the room (B,) with the current on for ever, by Newton's
    method."""
    system = _System(stators, rig)
    here = np.repeat(ambient_degC[:, None] + 80.0, len(LUMPS), axis=1)
    lost = np.zeros(stators.size)
    for _ in range(60):
        matrix = system.jacobian(here, ambient_degC, rig.current_A)
        net, lost = system.balance(here, ambient_degC, rig.current_A)
        change = np.linalg.solve(matrix, -net[:, :, None])[:, :, 0]
        here = here + change
        if float(np.abs(change).max()) < 1e-10:
            break
    return here, system.heat(here, rig.current_A).sum(axis=1), lost
