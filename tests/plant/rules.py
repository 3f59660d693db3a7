"""How an engineer makes the motor file of a form: `RULES` has each by name. No rule knows a specimen."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

from plant.forms import Form
from plant.motor_file import motor_file
from plant.reduction import reduce


def fitted(form: Form) -> str:
    """Conductances of the mesh, losses fitted to the loss map: `reduction`."""
    return motor_file(form, reduce(form), form.spreads)


RULES: Mapping[str, Callable[[Form], str]] = MappingProxyType({"fitted": fitted})
