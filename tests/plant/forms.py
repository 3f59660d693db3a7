"""Every form of the plant, by name. The jacketed motor is the first of them; the others differ from it in what a file's
maker may not know of: where iron loss falls with current, what cools the winding heads, how much of the housing is
cooled at all."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from plant.bar_wound import JACKETED, WEAKENED
from plant.form import Form
from plant.wire_wound import HOUSED, SECTION, SPRAYED

__all__ = ["FORMS", "HOUSED", "JACKETED", "SECTION", "SPRAYED", "WEAKENED", "Form"]

FORMS: Mapping[str, Form] = MappingProxyType(
    {"jacketed": JACKETED, "weakened": WEAKENED, "sprayed": SPRAYED, "housed": HOUSED, "section": SECTION}
)
