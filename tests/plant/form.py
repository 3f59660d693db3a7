"""What makes a motor's form: geometry, cooling, machine, loss and film laws, sensors."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from plant.drives import Vehicle
from plant.films import NOMINAL, Film
from plant.geometry import GLYCOL, Geometry, Material
from plant.losses import LossDesign
from plant.machine import Machine
from plant.mesh import Mesh, jacketed
from plant.thermocouples import SENSORS, Sensor

Path = tuple[str, str]  # cell, cell or boundary


def paths(layers: int) -> tuple[Path, ...]:
    """Heat paths that no motor file has, for a winding of so many layers."""
    inner = layers - 1
    return (
        *(("crown_a0", "sleeve.0"), ("crown_b0", "sleeve.last"), ("near_a0", "sleeve.0"), ("busbar", "ambient")),
        *(("journal_b", "ambient"), ("hub_b", "ambient"), (f"near_b{inner}", "tooth_tip.last")),
        *(("rack", "sleeve.last"), (f"crown_a{inner}", "hub_a"), ("air_b_out", "sleeve.last")),
    )


@dataclass(frozen=True, eq=False)
class Form:
    """One motor as designed. `build` makes its mesh of so many slices; `rated`: speed [rpm] and torque [Nm] of its
    continuous point; `spreads`: whether its fitted file says how badly some of its values are known."""

    name: str
    build: Callable[[Geometry, int], Mesh] = jacketed
    geometry: Geometry = field(default_factory=Geometry)
    losses: LossDesign = field(default_factory=LossDesign)
    films: Mapping[str, Film] = field(default_factory=lambda: NOMINAL)
    coolant: Material = GLYCOL
    sensors: tuple[Sensor, ...] = SENSORS
    paths: tuple[Path, ...] = paths(6)
    rated: tuple[float, float] = (6000.0, 75.0)
    vehicle: Vehicle = field(default_factory=Vehicle)
    spreads: bool = False

    @property
    def machine(self) -> Machine:
        """Its electric side."""
        return self.losses.machine
