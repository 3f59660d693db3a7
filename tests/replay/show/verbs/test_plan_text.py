"""What `whyhot plan` prints of a size."""

from __future__ import annotations

import pytest

from replay.show.verbs.plan import looks_like, shows_from
from twin.differences.candidates import Candidate
from twin.differences.sizes import Sigma
from twin.fitting import actions
from twin.motor.causes import Cause
from twin.planning.detectable import Detectable


@pytest.mark.parametrize(
    ("cause", "unit", "smallest", "says"),
    [
        (Cause("capacity", "winding", "scale"), "1", 0.8, "factor 2.2"),
        (Cause("sensor", "winding", "gain"), "1", 0.031, "3.1 %"),
        (Cause("conductance", "winding-yoke", "scale"), "W/K", 24.2, "24 W/K"),
    ],
)
def test_the_smallest_size_that_shows_is_a_factor_a_share_or_has_a_unit(
    cause: Cause, unit: str, smallest: float, says: str
) -> None:
    candidate = Candidate(cause, unit, Sigma(0.3), 0, actions.Capacity((0,)))
    assert shows_from(Detectable(candidate, smallest, unit, 1.5, 1.0, ())) == says


def test_names_of_causes_are_not_broken_over_lines() -> None:
    candidate = Candidate(Cause("loss", "magnet", "speed"), "W", Sigma(0.3), 0, actions.Capacity((0,)))
    alike = ("conductance.rotor_core-oil_rotor.scale", "conductance.rotor_core-oil_rotor.constant")
    lines = looks_like(Detectable(candidate, 20.0, "W", 1.5, 1.0, alike))
    assert len(lines) == 2 and all(name in " ".join(lines).split() for name in alike)
