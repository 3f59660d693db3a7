"""What differs between two runs that were driven alike, and what explains it."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from ingest.errors import IngestError
from ingest.morning.differences import beyond_of
from ingest.morning.repeat import Comparison, comparison_json, lay
from made.channels import channel
from made.repeated import run


def _exceeding(beside: Comparison) -> list[str]:
    return [one.channel for one in beside.exceeding]


@pytest.mark.parametrize("seed", range(6))
def test_other_starts_coolants_and_loads_are_no_difference(seed: int) -> None:
    off = (-1.0) ** seed
    first = run(seed, noise_seed=1)
    second = run(seed, 60 + 4 * off, 60 - 15 * off, 40 * seed, 1 + 0.015 * off, noise_seed=2)
    verdicts = {one.channel: one.verdict for one in lay(first, second).channels}
    assert verdicts.pop("T_coolant") == "exceeds"  # it was driven differently, and that is said
    assert "exceeds" not in verdicts.values()


def test_a_sensor_that_reads_too_much_exceeds_its_floor_and_no_other_does() -> None:
    beside = lay(run(), run(rest_s=200, winding_K=3.0, noise_seed=2))
    (one,) = beside.exceeding
    assert one.channel == "T_winding"
    assert one.floor == pytest.approx(1.414, abs=0.01)
    assert one.difference == pytest.approx(3.0, abs=0.2)
    low, high = one.worst.explained
    assert high < 1.5 and low <= 0.0
    said = next(said for said in comparison_json(beside)["channels"] if said["channel"] == "T_winding")["worst"]
    assert said["second"] - said["first"] == said["difference"] == pytest.approx(3.0, abs=0.5)
    assert 20.0 < said["first"] < 150.0


def test_a_weaker_film_exceeds_the_floor_where_it_is_warm() -> None:
    found = {one.channel: one for one in lay(run(), run(film=0.7, noise_seed=2)).channels}
    assert found["T_winding"].verdict == found["T_yoke"].verdict == "exceeds"
    assert found["n"].verdict == found["M"].verdict == found["T_coolant"].verdict == "within"


def test_what_earlier_runs_differed_by_is_a_floor_too() -> None:
    first, second = run(), run(winding_K=3.0, noise_seed=2)
    restless = [beyond_of(lay(first, run(winding_K=off, noise_seed=3)).channels) for off in (3.5, -1.0)]
    one = next(one for one in lay(first, second, restless).channels if one.channel == "T_winding")
    assert (one.verdict == "exceeds", one.repeats) == (False, 2)
    assert one.floor > 1.5


def test_runs_of_other_operating_points_are_not_compared() -> None:
    with pytest.raises(IngestError, match=r"^a and b: speed and torque are in no minute alike"):
        lay(run(1), [channel("n", "speed", [9e3] * 900), channel("M", "torque", [1.0] * 900)], (), "a and b")


@pytest.mark.parametrize("left", [["T_winding"], []])
def test_without_anything_that_drives_nothing_says_where_it_was_driven(left: Sequence[str]) -> None:
    some = [one for one in run() if one.spec.name in left]
    with pytest.raises(IngestError, match="say in a bench file what the signals mean"):
        lay(some, some)


def test_channels_that_one_run_lacks_are_named() -> None:
    first = run()
    assert lay(first, [one for one in first if one.spec.name != "T_yoke"]).only == (("T_yoke",), ())


def test_a_channel_that_is_called_like_a_quantity_is_compared_as_itself() -> None:
    named = channel("speed", "flow", [5.0] * 3000)
    (one,) = [one for one in lay([*run(), named], [*run(noise_seed=2), named]).channels if one.channel == "speed"]
    assert (one.first, one.second) == (5.0, 5.0)
