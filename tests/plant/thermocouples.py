"""Where the thermocouples of a motor stand: mixtures of cells."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Sensor:
    """A thermocouple `signal` for `node`; `cells`: stem -> weight as designed; `radio`: sent from the rotor."""

    signal: str
    node: str
    cells: tuple[tuple[str, float], ...]
    radio: bool = False


def thermocouples(layers: int) -> tuple[Sensor, ...]:
    """Those of a winding of so many layers, glued between two of them to one. {m} is the middle slice, {e} the
    last."""
    inner, innermost, above = layers - 2, layers - 1, layers - 3
    return (
        Sensor(
            *("EW_A_inner", "endwinding_a_inner"),
            ((f"crown_a{inner}", 0.5), (f"crown_a{innermost}", 0.3), (f"near_a{inner}", 0.2)),
        ),
        Sensor(
            *("EW_B_inner", "endwinding_b_inner"),
            ((f"crown_b{inner}", 0.5), (f"crown_b{above}", 0.3), (f"near_b{inner}", 0.2)),
        ),
        Sensor("EW_A_outer", "endwinding_a_outer", (("crown_a1", 0.6), ("crown_a0", 0.2), ("near_a1", 0.2))),
        Sensor("EW_B_outer", "endwinding_b_outer", (("crown_b1", 0.6), ("crown_b2", 0.2), ("near_b1", 0.2))),
        Sensor("TC_teeth", "teeth", (("tooth_mid.0", 0.5), ("tooth_mid.1", 0.3), ("tooth_root.0", 0.2))),
        Sensor("TC_yoke", "yoke", (("yoke_out.{e}", 0.5), ("yoke_in.{e}", 0.4), ("yoke_in.{m}", 0.1))),
        Sensor("RS", "rotor_surface", (("surface.1", 0.7), ("surface.0", 0.3)), True),
        Sensor("MAG", "magnet", (("magnet.{m}", 0.7), ("magnet.1", 0.3)), True),
        Sensor("TC_housing", "housing", (("case.{m}", 0.8), ("shield_b", 0.2))),
        Sensor("TC_bearing_a", "bearing_a", (("race_a_out", 0.8), ("hub_a", 0.2))),
    )


SENSORS = thermocouples(6)
