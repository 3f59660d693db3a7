"""The prior size of an amplitude: a fixed share of a scale of this motor in this campaign."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from twin.motor.paths import Place


@dataclass(frozen=True)
class Scales:
    """Sizes of this motor over the tests of a campaign: mean total loss [W], and the mean conductance [W/K] of each
    link, by its place as cause ids write it (`winding-yoke`)."""

    total_loss_W: float
    conductance_W_per_K: Mapping[str, float]

    def at(self, node: str) -> float:
        """The largest mean conductance at a node or boundary; infinite where nothing is joined to it, so that the other
        end of a missing link sizes it."""
        return self._largest.get(node, float("inf"))

    @cached_property
    def _largest(self) -> Mapping[str, float]:
        """Node or boundary -> its largest mean conductance."""
        found: dict[str, float] = {}
        for place, conductance in self.conductance_W_per_K.items():
            for end in place.split("-"):
                found[end] = max(conductance, found.get(end, conductance))
        return found


@dataclass(frozen=True)
class Sigma:
    """Prior sd of an amplitude: `share` times the scale `of`. Scales are `unit` (1), `total_loss`, `own_conductance`
    (of the links at the places, their mean), and `smaller_neighbour`: each end of a missing link has a largest
    conductance, the smaller of the two counts; mean of the places."""

    share: float
    of: str = "unit"
    places: tuple[Place, ...] = ()

    def value(self, scales: Scales) -> float:
        """In the amplitude's unit."""
        if self.of == "total_loss":
            return self.share * scales.total_loss_W
        if self.of == "own_conductance":
            return self.share * float(np.mean([scales.conductance_W_per_K["-".join(place)] for place in self.places]))
        if self.of == "smaller_neighbour":
            return self.share * float(np.mean([min(scales.at(end) for end in place) for place in self.places]))
        return self.share
