"""Electrical checks of the insulation, one row each: resistance, polarisation index, capacitance, tan delta,
discharge inception.

They follow the slot insulation loosely: as it deteriorates its resistance and its inception voltage fall and its loss
factor rises, each with a scatter of its own.
"""

from __future__ import annotations

from datetime import timedelta

import numpy as np

from plant.tables import Column, Style

AFTER = timedelta(hours=5)  # of the DC check of the day: the stator is cold again
# signal, quantity, unit, of a new stator, change of its ln by ln of the slot resistance, scatter of its ln, digits
VALUES = (
    ("R_iso", "insulation_resistance", "GOhm", 40.0, -2.0, 0.15, 2),
    ("PI", "polarisation_index", "1", 3.4, -0.3, 0.04, 2),
    ("C_ground", "capacitance", "nF", 8.2, -0.4, 0.004, 3),
    ("tan_delta", "tan_delta", "1", 0.006, 0.6, 0.03, 5),
    ("PDIV", "inception_voltage", "V", 980.0, -0.25, 0.02, 0),
)


def inception_V(ln_insulation: float) -> float:
    """The true inception voltage [V], with ln of the slots' resistance over what it was when new."""
    _, _, _, new, slope, *_ = VALUES[-1]
    return new * float(np.exp(slope * ln_insulation))


def columns(random: np.random.Generator, ln_insulation: float) -> list[Column]:
    """The row of a check, with ln of the slots' resistance over what it was when new."""
    found = []
    for signal, _, unit, new, slope, scatter, digits in VALUES:
        value = new * np.exp(slope * ln_insulation + scatter * random.standard_normal())
        found.append(Column(signal, unit, np.array([value]), digits))
    return found


def bench_toml(style: Style) -> str:
    """The bench file of such checks."""
    text = f'schema = "whyhot.bench/1"\nkind = "insulation_check"\n\n{style.toml}'
    for signal, quantity, unit, *_ in VALUES:
        text += f'\n[[channel]]\nsignal = "{signal}"\nquantity = "{quantity}"\nunit = "{unit}"\n'
    return text
