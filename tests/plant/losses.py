"""Where the heat comes from: copper by layer, iron by region from flux and frequency, magnets, bearings, windage,
ripple.

Heat is groups of one course over time each, spread over cells by shares that add up to 1 (copper: to its W/A2).
`LossDesign` holds what differs between motors; its values are the jacketed motor's.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from plant.geometry import ALPHA_COPPER, RHO_COPPER_20
from plant.machine import MACHINE, Machine, Point
from plant.mesh import Mesh, along

Floats = NDArray[np.float64]

MU0 = 4e-7 * np.pi
HOT100 = 1.0 + ALPHA_COPPER * 80.0
HEATS = (
    *("tips", "teeth", "yoke", "surface", "core", "magnet", "ripple", "gap_drag", "end_drag"),
    *("bearing_a", "bearing_b", "contact"),
)
SLOPES = {
    "magnet": -0.0008,
    "bearing_a": -0.004,
    "bearing_b": -0.004,
    "surface": -0.0005,
}  # 1/K about 100 degC, by node


@dataclass(frozen=True)
class Iron:
    """Loss [W/kg] of a sheet at f [Hz] and B [T]: hysteresis, eddy currents, excess (Bertotti, IEEE Trans. Magn. 24
    (1988) 621). 0.27 mm has 13 W/kg at 400 Hz and 1 T."""

    hysteresis: float = 0.012
    exponent: float = 1.7
    eddy: float = 5.1e-5
    excess: float = 0.0

    def loss(self, frequency: Floats, flux_density: Floats) -> Floats:
        """Loss [W/kg]."""
        rest = self.excess * (frequency * flux_density) ** 1.5
        return (
            self.hysteresis * frequency * flux_density**self.exponent
            + self.eddy * frequency**2 * flux_density**2
            + rest
        )


Course = tuple[tuple[float, float, float], ...]  # W at full speed and current, power of speed, power of current


@dataclass(frozen=True)
class LossDesign:
    """Where a motor's heat comes from. Masses [kg] of iron hold its building factor; `saturation_T`, `knee`: density
    in the teeth over flux; `weakening`: share more in the yoke, and W more in the tooth tips, at full d current;
    `ripple_W` of the inverter; `end_ac`: of the slots' mean rise of resistance, in the end windings; `terminal_ohm`
    of a phase; `courses` of the other groups."""

    machine: Machine = MACHINE
    iron: Iron = Iron()
    saturation_T: float = 1.95
    knee: float = 1.25
    tips_kg: float = 2.1
    teeth_kg: float = 1.5 * 2.6
    yoke_kg: float = 1.3 * 9.6
    yoke_density: float = 0.75  # of the teeth's
    weakening: float = 0.25
    weakening_W: float = 420.0
    ripple_W: float = 9.0
    end_ac: float = 0.16
    terminal_ohm: float = 0.20e-3
    courses: Mapping[str, Course] = field(
        default_factory=lambda: {
            "surface": ((140.0, 1.7, 0.0), (380.0, 1.6, 1.9)),
            "core": ((35.0, 1.3, 0.0), (40.0, 1.0, 1.0)),
            "magnet": ((85.0, 1.9, 0.0), (340.0, 1.9, 1.9)),
            "gap_drag": ((110.0, 2.8, 0.0),),
            "end_drag": ((45.0, 2.8, 0.0),),
            "bearing_a": ((105.0, 1.6, 0.0), (4.0, 1.0, 0.0)),
            "bearing_b": ((88.0, 1.6, 0.0), (4.0, 1.0, 0.0)),
            "contact": ((45.0, 0.0, 2.0),),
        }
    )

    def tooth_density(self, flux: Floats) -> Floats:
        """Flux density [T] in the teeth at a flux linkage [Wb]; saturates."""
        return self.saturation_T * (1.0 - np.exp(-self.knee * flux / self.machine.psi_Wb))


@dataclass(frozen=True)
class LossLaws:
    """The loss laws of one specimen of a design: factor and change of the speed exponent (`tilt`) of each group, of AC
    and of DC copper."""

    design: LossDesign = field(default_factory=LossDesign)
    factor: Mapping[str, float] = field(default_factory=dict)
    tilt: Mapping[str, float] = field(default_factory=dict)

    def of(self, group: str, speed: Floats) -> Floats:
        """What a group's loss is multiplied by (M,) at these speeds."""
        return self.factor.get(group, 1.0) * np.maximum(speed, 0.02) ** self.tilt.get(group, 0.0)


def heats(laws: LossLaws, point: Point, speed_rpm: Floats, inverter: Floats) -> Floats:
    """Heat of each group (M, groups) [W] in the order of HEATS."""
    d, machine = laws.design, laws.design.machine
    s, i = np.abs(speed_rpm) / machine.top_rpm, point.current / machine.current_A
    f = s * machine.top_Hz
    weakening = np.maximum(-point.i_d, 0.0) / machine.peak_A
    density = d.tooth_density(point.gap_flux)
    modulation = np.minimum(np.hypot(point.u_d, point.u_q) / machine.voltage_V, 1.0)
    ripple = inverter * (0.5 + 2.0 * modulation * (1.0 - modulation)) * (1.0 + 0.8 * i)
    course = {
        "tips": d.tips_kg * d.iron.loss(f, 0.95 * density) + d.weakening_W * s**1.8 * weakening**1.2,
        "teeth": d.teeth_kg * d.iron.loss(f, density),
        "yoke": d.yoke_kg * d.iron.loss(f, d.yoke_density * density) * (1.0 + d.weakening * weakening),
        "ripple": d.ripple_W * ripple,
    }
    for name, terms in d.courses.items():
        course[name] = np.sum([watts * s**by_speed * i**by_current for watts, by_speed, by_current in terms], axis=0)
    return np.stack([course[name] * laws.of(name, s) for name in HEATS], axis=1)


def shares(mesh: Mesh) -> Floats:
    """How each group of HEATS spreads over the cells (groups, n)."""
    n, index, z = mesh.axial, mesh.index, np.linspace(-1.0, 1.0, mesh.axial)
    result = np.zeros((len(HEATS), len(mesh.cells)))

    def put(group: str, stem: str, total: float, form: Floats | None = None) -> None:
        weight = np.ones(n) if form is None else form
        result[HEATS.index(group), along(mesh, stem)] += total * weight / weight.sum()

    ends, middle = 1.0 + 0.25 * z**4, 1.25 - 0.5 * z**2
    put("tips", "tooth_tip", 1.0, ends)
    put("teeth", "tooth_mid", 0.52)
    put("teeth", "tooth_root", 0.48)
    put("yoke", "yoke_in", 0.56)
    put("yoke", "yoke_out", 0.44)
    put("surface", "surface", 1.0, ends)
    put("core", "core_out", 1.0)
    put("magnet", "magnet", 1.0, middle)
    for stem, part in (("magnet", 0.4), ("surface", 0.35), ("tooth_tip", 0.25)):
        put("ripple", stem, part)
    put("gap_drag", "gap", 1.0)
    for cell in ("air_a_in", "air_b_in"):
        result[HEATS.index("end_drag"), index[cell]] = 0.5
    for side in "ab":
        result[HEATS.index(f"bearing_{side}"), [index[f"race_{side}_in"], index[f"race_{side}_out"]]] = 0.5
    result[HEATS.index("contact"), index["busbar"]] = 1.0
    return mesh.spread(result)


def direct(mesh: Mesh, terminal_ohm: float) -> Floats:
    """DC loss of each cell (n,) [W/A2] at 20 degC for the rms current of a phase: 3 R I^2 of what copper a cell
    holds."""
    result = _direct_in_layers(mesh)
    result[mesh.index["busbar"]] = 3 * terminal_ohm
    return mesh.spread(result)


def _direct_in_layers(mesh: Mesh) -> Floats:
    """The same of the layers alone, nothing of it in second halves of cells."""
    g, index = mesh.geometry, mesh.index
    per_m = g.slots * (g.turns / g.paths) ** 2 * RHO_COPPER_20 / g.bar_area
    result = np.zeros(len(mesh.cells))
    for k in range(g.layers):
        result[along(mesh, f"bar{k}")] = per_m * g.stack / mesh.axial
        for side in "ab":
            result[index[f"near_{side}{k}"]] = per_m * g.near_length
            result[index[f"crown_{side}{k}"]] = per_m * g.crown(side)
    return result


def skin(mesh: Mesh, frequency: Floats) -> Floats:
    """R_ac / R_dc - 1 of each layer (M, layers) at 100 degC: Dowell / Emde, kr = phi + k (k - 1) psi of the k-th
    conductor from the slot bottom, with xi = h sqrt(pi f mu0 b_copper / (rho b_slot)); the mean of a layer's."""
    g = mesh.geometry
    rho = RHO_COPPER_20 * HOT100
    breadth = g.copper_breadth
    xi = g.conductor_height * np.sqrt(np.pi * np.maximum(frequency, 0.1) * MU0 * breadth / (rho * g.slot_width))
    phi = xi * (np.sinh(2 * xi) + np.sin(2 * xi)) / (np.cosh(2 * xi) - np.cos(2 * xi))
    psi = 2 * xi * (np.sinh(xi) - np.sin(xi)) / (np.cosh(xi) + np.cos(xi))
    k = np.arange(1, g.layers * g.conductors_high + 1)
    rise: Floats = phi[:, None] - 1.0 + k * (k - 1) * psi[:, None]
    layers: Floats = rise.reshape(-1, g.layers, g.conductors_high).mean(axis=2)
    return layers


def alternating(laws: LossLaws, mesh: Mesh, current2: Floats, speed_rpm: Floats) -> Floats:
    """I^2 (R_ac / R_dc - 1) [A2] of each bar of the slot, and behind them of the end windings (M, layers + 1): the AC
    loss of a cell at T is this times its W/A2 divided by 1 + alpha (T - 20)."""
    machine = laws.design.machine
    s = np.abs(speed_rpm) / machine.top_rpm
    rises = skin(mesh, s * machine.top_Hz) * HOT100**2 * current2[:, None]
    slot = rises * laws.of("ac_slot", s)[:, None]
    end = laws.design.end_ac * rises.mean(axis=1) * laws.of("ac_end", s)
    return np.column_stack([slot, end])


def alternating_shares(mesh: Mesh) -> Floats:
    """AC loss of each cell (layers + 1, n) [W/A2] at 20 degC; the inner layers of the end windings lie in more of the
    stray field."""
    g, index, dc = mesh.geometry, mesh.index, _direct_in_layers(mesh)
    result = np.zeros((g.layers + 1, len(mesh.cells)))
    for k in range(g.layers):
        bars = along(mesh, f"bar{k}")
        result[k, bars] = dc[bars]
        for side in "ab":
            near, crown = index[f"near_{side}{k}"], index[f"crown_{side}{k}"]
            form = 0.7 + 0.6 / (g.layers - 1) * k
            result[-1, near], result[-1, crown] = 1.3 * form * dc[near], 0.8 * form * dc[crown]
    return mesh.spread(result)
