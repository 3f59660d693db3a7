"""The heat of a session as bands: as wide as their watts, and the same on both sides."""

from __future__ import annotations

import re

import pytest

from made.runs import heated, made_run
from replay.show.plots.heat_plots import heat_balance

KINDS = {"copper_dc": 600.0, "copper_ac": 150.0, "iron": 200.0, "magnet": 45.0, "mechanical": 4.0, "other": 1.0}
TAKEN = {"coolant": 900.0, "ambient": -50.0}
PART = re.compile(r">([^<>]+?) ([\d,.]+) W, (\d+) %</text>")


def test_what_comes_in_goes_out_and_each_part_says_its_watts_and_share() -> None:
    plot = heat_balance(heated(made_run(), KINDS, TAKEN), 100)
    assert plot is not None
    assert plot.title == "1,050 W of heat on average: 57 % from copper DC, 86 % into coolant"
    parts = {name: (float(watts.replace(",", "")), int(share)) for name, watts, share in PART.findall(plot.svg)}
    assert parts == {
        "copper DC": (600, 57),
        "copper AC": (150, 14),
        "iron": (200, 19),
        "magnets": (45, 4),
        "bearings and windage": (4, 0),
        "other": (1, 0),
        "from ambient": (50, 5),
        "coolant": (900, 86),
        "stored": (150, 14),
    }


def test_what_rounds_to_nothing_has_no_sign() -> None:
    plot = heat_balance(heated(made_run(), KINDS | {"other": -0.001}, TAKEN), 100)
    assert plot is not None
    shares = {row[1]: row[3] for row in plot.table.rows if row[0] == "made, by kind"}
    assert shares["other"] == "0.0"


def test_the_heat_of_a_long_session_is_a_number_of_kilojoules() -> None:
    plot = heat_balance(heated(made_run(), {"iron": 3e6, "magnet": 1e6}, {"coolant": 4e6}), 100)
    assert plot is not None
    energies = [row[2] for row in plot.table.rows if row[0].startswith("made")]
    assert energies and all(re.fullmatch(r"[1-9]\d{0,2}(,\d{3})*", energy) for energy in energies), energies


def test_ends_of_bands_are_as_high_as_their_amounts() -> None:
    plot = heat_balance(heated(made_run(), {"iron": 300.0, "magnet": 100.0}, {"coolant": 400.0}), 100)
    assert plot is not None
    boxes = re.findall(
        r'<path d="M ([\d.]+) ([\d.]+) L ([\d.]+) \2 L \3 ([\d.]+) L \1 \4 z "[^>]*style="fill: var', plot.svg
    )
    heights = [abs(float(bottom) - float(top)) for _, top, _, bottom in boxes]
    trunk, iron, magnets, coolant, *_ = heights
    assert iron == pytest.approx(3 * magnets, rel=1e-3)
    assert trunk == pytest.approx(iron + magnets, rel=1e-3) == pytest.approx(coolant, rel=1e-3)
