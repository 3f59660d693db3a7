"""What is said of filter and smoother in the terminal and the report, and why a run has none."""

from __future__ import annotations

from typing import Any

import pytest

from made.runs import made_summary
from replay.engine.results.summary import Summary
from replay.show.reports.report import heat_says
from replay.show.words.filter_words import compared, filter_says, left_out, loss, worst_compared
from replay.show.words.terminal import replay_text

COURSE = {"mean_W": 161.2, "sd_W": 17.0, "max_W": 193.3, "max_sd_W": 16.1, "max_at_s": 280.5}
SPOT: dict[str, Any] = {"max_degC": 120.0, "at_s": 1190.0, "limit_degC": 150.0, "margin_K": 30.0}
BAND = {"sd_K": 1.0, "ci95_degC": [118.0, 122.0], "checked_by": ["MAG"]}
NONE: dict[str, Any] = {"sd_K": None, "ci95_degC": None, "checked_by": []}
CHANNELS: list[dict[str, Any]] = [
    {"channel": channel, "node": node, "mae_K": mae, "max_K": mae, "bias_K": mae, "floor_K": 0.5, "masked": 0}
    | {"max_at_s": 60.0, "where": {}, "white_K": 0.3, "bias_sd_K": 0.4, "samples": 2400}
    for channel, node, mae in (("MAG", "magnet", 11.4), ("RS", "rotor_surface", 11.1), ("teeth", "teeth", 12.0))
]
OLD_FILTERED: dict[str, Any] = {  # what the first runs with a filter have of it
    "node": "magnet",
    "measured": ["RS", "teeth"],
    "mae_K": {"MAG": 1.21},
    "heat_bias_W": 139.2,
    "heat_walk_W_per_sqrt_s": 2.0,
    "nis": 1.0,
}
FILTERED: dict[str, Any] = {
    **OLD_FILTERED,
    "smoothed_mae_K": {"MAG": 1.07},
    "read_mae_K": {"RS": 0.2, "teeth": 0.1},
    "smoothed_read_mae_K": {"RS": 0.1, "teeth": 0.1},
    "heat": {"modelled_mean_W": 22.0, "filter": {**COURSE, "mean_W": 153.0}, "smoother": COURSE},
    "hot_spots": {"winding": {**SPOT, **NONE, "node": "winding"}, "magnet": {**SPOT, **BAND, "node": "magnet"}},
}


def summary(**more: Any) -> Summary:
    return made_summary(**{"channels": CHANNELS, "filtered": FILTERED, **more})


def test_the_loss_is_said_with_where_mean_peak_and_sd() -> None:
    assert loss(summary()) == (
        "smoother, from 2 channels: 161 W of loss at the magnet on average (sd 17 W at any time) and 193 W at most "
        "(sd 16 W, at 0:04:40), where the model has 22 W"
    )
    alone = {**FILTERED, "heat": {**FILTERED["heat"], "smoother": None}}
    assert str(loss(summary(filtered=alone))).startswith("filter, from 2 channels: 153 W of loss")


def test_a_withheld_channel_is_compared_with_the_open_loop() -> None:
    assert compared(summary()) == [
        "magnet (MAG, not read by the filter): open loop 11.4 K off on average, filter 1.2 K, smoother 1.1 K"
    ]
    assert worst_compared(summary()) == "MAG"


def test_where_all_channels_are_read_the_one_that_is_furthest_off_in_open_loop_is_compared() -> None:
    every = summary(filtered={**FILTERED, "mae_K": {}, "smoothed_mae_K": {}})
    assert compared(every) == [
        "teeth (read by the filter, as all are): open loop 12.0 K off on average, filter 0.1 K, smoother 0.1 K"
    ]
    assert worst_compared(every) == "teeth"


def test_the_smoothers_hot_spots_say_their_band_what_it_holds_and_where_there_is_none() -> None:
    *_, said = filter_says(summary())
    assert said == (
        "hottest by the smoother: winding 120 °C at 0:19:50 (30.0 K under its limit) and magnet 120 °C (118 to 122) "
        "at 0:19:50 (30.0 K under its limit); 95 %, by how far it is off MAG and what these may read too much; no "
        "band at winding, where no channel could check it"
    )


def test_what_was_asked_for_is_said_in_its_own_unit() -> None:
    numbers = {"mean": 1.31, "sd": 0.052, "min": 1.2, "max": 1.5}
    asked = [
        {"id": "conductance.rotor_surface-teeth.scale", "unit": "1", **numbers},
        {"id": "sensor.teeth.bias", "unit": "K", **numbers, "mean": -0.4, "min": -0.4},
    ]
    said = "; ".join(filter_says(summary(filtered={**FILTERED, "unknowns": asked})))
    assert (
        "asked for: conductance.rotor_surface-teeth.scale times 1.31 on average (sd 0.052 at any time, 1.2 to 1.5)"
        in said
    )
    assert "sensor.teeth.bias −0.4 K on average (sd 0.052 K at any time, −0.4 to 1.5 K)" in said


LARGE = {"why_no_band": "the network has 139 nodes, more than 100"}


@pytest.mark.parametrize(
    ("spots", "says"),
    [
        ({"magnet": LARGE}, ["no band and no filter: the network has 139 nodes, more than 100"]),
        ({"magnet": {}}, ["no filter: no channel of level production that it may read"]),
        (
            {"winding": LARGE},
            ["no band and no filter: the network has 139 nodes, more than 100"],
        ),
        ({"winding": {}}, ["no filter: the motor has no magnet and no rotor whose loss it could find"]),
        (
            {"magnet": {"why_no_band": "the model runs away"}},
            ["no band: the model runs away", "no filter: no channel of level production that it may read"],
        ),
    ],
)
def test_why_there_is_no_filter_or_no_band(spots: dict[str, Any], says: list[str]) -> None:
    whole = {spot: {**SPOT, "node": spot, **one} for spot, one in spots.items()}
    assert left_out(summary(hot_spots=whole, filtered=None, level="production")) == says


def test_nothing_is_said_of_runs_that_were_sealed_before_there_was_a_filter() -> None:
    assert list(filter_says(made_summary(channels=CHANNELS))) == []
    (said,) = filter_says(summary(filtered=OLD_FILTERED))
    assert said == "magnet (MAG, not read by the filter): open loop 11.4 K off on average, filter 1.2 K"


def test_the_report_says_it_and_the_terminal_what_was_asked_for() -> None:
    numbers = {"id": "sensor.teeth.bias", "unit": "K", "mean": -0.4, "sd": 0.052, "min": -0.4, "max": 1.5}
    whole = summary(filtered={**FILTERED, "unknowns": [numbers]})
    assert set(filter_says(whole)) <= set(heat_says(whole))
    asked = "Asked for         1_s1: sensor.teeth.bias −0.4 K on average (sd 0.052 K at any time, −0.4 to 1.5 K)"
    assert asked in replay_text([whole], "whyhot report 1_s1").splitlines()
