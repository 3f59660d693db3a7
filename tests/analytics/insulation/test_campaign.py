"""Everything that checks of many specimens say is the same wherever their courses are weighed."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest

from analytics.errors import WorkerLostError
from analytics.insulation import campaign
from ingest.units.each import Lost, Workers


def checks() -> dict[str, Any]:
    """Five specimens with four checks each."""
    names = [f"S{k // 4}" for k in range(20)]
    dose = np.tile([0.0, 50.0, 100.0, 150.0], 5)
    resistance = 0.02 * np.exp(2e-3 * dose + 0.02 * np.random.default_rng(1).standard_normal(20))
    said = {"dose_h": dose, "resistance_K_per_W": resistance, "sd_K_per_W": np.zeros(20)}
    return {"specimen": names, "batch": ["B"] * 20, **said}


def test_the_answer_is_the_same_with_workers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(campaign, "AT_ONCE", 2)
    said: list[str] = []
    alone = campaign.assess(**checks())
    shared = campaign.assess(**checks(), workers=Workers(lambda _: ThreadPoolExecutor(2)), tell=said.append)
    assert list(shared.forms) == list(alone.forms)
    assert (shared.forms, shared.fleet, shared.remaining) == (alone.forms, alone.fleet, alone.remaining)
    assert said[-1] == "weighed the courses of 5 of 5 specimens"


def test_courses_are_weighed_of_the_specimens_that_are_chosen_by_how_all_compare() -> None:
    alone = campaign.assess(**checks())
    some = campaign.assess(**checks(), whose=lambda fleet: [one.specimen for one in fleet.specimens[1:3]])
    assert some.forms == {name: alone.forms[name] for name in ("S1", "S2")}
    assert (some.fleet, some.remaining) == (alone.fleet, alone.remaining)


def test_specimens_that_no_worker_can_weigh_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(campaign, "each", lambda _, jobs, __: ((job, Lost()) for job in jobs))
    with pytest.raises(WorkerLostError, match="the courses of S0 to S4: the process that worked on it ended"):
        campaign.assess(**checks())
