"""Where the design says that a thermocouple stands between two nodes of the motor file, as the `weights` of a bench
file say it.

The rotor's surface is hottest in the middle of the stack; the radio's thermocouple is glued near end A. Like the
motor file this is the design's, and knows no specimen.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

import numpy as np
from numpy.typing import NDArray

from plant.drives import wltp
from plant.forms import JACKETED, Form
from plant.plant import Plant

Floats = NDArray[np.float64]

TOWARDS = {"RS": "end_plate_a"}  # the magnets' stands in the middle, which is hotter than any mixture of nodes
SETTLE = 0.25  # of the cycle: after the start


@cache
def weights(signal: str, form: Form = JACKETED) -> Mapping[str, float]:
    """Node -> share, to two digits: least squares over a WLTC of the motor as designed; the node alone of one that is
    not in `TOWARDS`."""
    (sensor,) = (one for one in form.sensors if one.signal == signal)
    if signal not in TOWARDS:
        return {sensor.node: 1.0}
    plant = Plant(0, roughness=0.0, form=form)
    mesh, run = plant.mesh, plant.run(wltp(1, form.vehicle))
    after = run.temperatures[int(SETTLE * len(run.temperatures)) :]

    def mean(node: str) -> Floats:
        cells = mesh.of_node(node)
        found: Floats = np.average(after[:, cells], axis=1, weights=mesh.capacity[cells])
        return found

    stems = [stem.format(m=mesh.axial // 2, e=mesh.axial - 1) for stem, _ in sensor.cells]
    place = np.average(
        after[:, [mesh.index[stem] for stem in stems]], axis=1, weights=[weight for _, weight in sensor.cells]
    )
    node, end = mean(sensor.node), mean(TOWARDS[signal])
    share = round(float((node - end) @ (node - place) / ((node - end) @ (node - end))), 2)
    return {sensor.node: round(1 - share, 2), TOWARDS[signal]: share}
