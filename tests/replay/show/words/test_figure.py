"""The empty figure that every plot begins from: where names at the ends of lines stand."""

from __future__ import annotations

import os
import subprocess
import sys
from itertools import pairwise

import pytest

from made.places import ROOT
from replay.show.words.figure import LINE, fitting, kept_apart, panels


@pytest.mark.parametrize("ends", [(9.8, 9.9, 10.0), (0.0, 0.1, 0.1), (10.4, 2.0, 2.1)])
def test_names_stand_apart_and_within_their_panel_so_that_none_meets_those_of_the_next(ends: tuple[float, ...]) -> None:
    height = 0.8  # inches: room for three names
    figure, (axes, _) = panels(7.6, (height, height))
    axes.set_ylim(0.0, 10.0)
    places = [place for place, _ in kept_apart(axes, [(y, f"line {y}") for y in ends])]
    step = LINE / (axes.get_position().height * figure.get_figheight())
    assert all(upper - lower >= step - 1e-9 for lower, upper in pairwise(places))
    assert places[0] >= 0.0 and places[-1] <= 1.0 + 1e-9


def test_a_name_loses_its_middle_where_its_letters_take_more_room_than_there_is() -> None:
    assert fitting("endwinding a outer") == "endwinding a outer"
    assert fitting("W" * 200) == "WWWW…WWWWW" and fitting("\u6e29" * 200) == "\u6e29" * 4 + "…" + "\u6e29" * 5
    assert fitting("TC\x1b[2J") == "TC\\u001b[2J", "what is written out counts as it is written"


def test_a_disk_that_keeps_no_list_of_fonts_is_no_matter() -> None:
    """A folder that cannot be made, on a machine where nothing was drawn before."""
    script = "from replay.cli import main; main([]); import replay.show.plots.plots"
    nowhere = {**os.environ, "MPLCONFIGDIR": "/proc/none", "PYTHONPATH": str(ROOT)}
    done = subprocess.run([sys.executable, "-c", script], env=nowhere, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
