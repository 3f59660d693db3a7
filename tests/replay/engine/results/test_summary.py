"""A run's summary as JSON and back; what runs hold that were sealed before there was an entry."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import pytest

from made.runs import made_summary
from replay.engine.results.summary import (
    FoundUnknown,
    IntegratorDistance,
    ModelledSpot,
    SpotProfile,
    Summary,
    document,
    read,
)
from replay.engine.specimen.aged import Aged

AGED = Aged(places=["slot"], above_degC=180.0, dose_h=1.0, factor=0.9, sd=0.1, from_="law")
SPOT = ModelledSpot(node="magnet", max_degC=130.0, at_s=9.0, limit_degC=None, margin_K=None)
TOP = SpotProfile(max_degC=131.0, towards="magnet_2", slices=0.2)
FILTERED: dict[str, Any] = {
    "node": "magnet",
    "measured": ["RS"],
    "mae_K": {"MAG": 1.2},
    "heat_bias_W": 1.0,
    "heat_walk_W_per_sqrt_s": 0.1,
    "nis": None,
}


def whole() -> Summary:
    """One with every entry that a run may have or lack."""
    found = made_summary(filtered=FILTERED)
    assert found.filtered is not None
    unknown = FoundUnknown(id="loss.magnet.scale", unit="1", mean=1.2, sd=0.1, min=1.0, max=1.5)
    return replace(
        found,
        integrator=IntegratorDistance(name="bdf2", error_K=0.1, node="magnet", at_s=3.0, against="sdirk2"),
        ageing=[AGED],
        hours={"hours_above_180degC": 1.0},
        hot_spots={"magnet": replace(SPOT, profile=TOP, why_no_band="too large")},
        filtered=replace(found.filtered, unknowns=[unknown]),
    )


def test_what_is_written_is_read_again() -> None:
    for summary in (whole(), made_summary()):
        stored = json.loads(json.dumps(document(summary)))
        assert read(stored) == summary
        assert document(read(stored)) == stored


def test_entries_that_say_nothing_are_not_in_the_json() -> None:
    told, untold = document(whole()), document(made_summary(filtered=FILTERED, hot_spots={"magnet": vars(SPOT)}))
    assert told.keys() - untold.keys() == {"integrator", "ageing", "hours"}
    assert told["hot_spots"]["magnet"].keys() - untold["hot_spots"]["magnet"].keys() == {"profile", "why_no_band"}
    assert told["filtered"].keys() - untold["filtered"].keys() == {"unknowns"}
    assert told["ageing"][0]["from"] == "law"
    assert untold["hot_spots"]["magnet"]["sd_K"] is None
    assert (untold["losses"], untold["limits"], untold["meters"]) == (None, {}, [])


def test_an_entry_that_is_not_known_is_passed_over() -> None:
    assert read({**document(whole()), "later": 1}) == whole()


def test_a_run_cannot_lack_what_every_run_has() -> None:
    with pytest.raises(TypeError, match="digest"):
        read({key: value for key, value in document(whole()).items() if key != "digest"})
