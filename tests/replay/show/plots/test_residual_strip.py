"""The strip of residuals: every channel a row, the one that is furthest off first, in colours that are drawn."""

from __future__ import annotations

import numpy as np
import pytest

from made.pictured import CHANNELS, many
from made.runs import made_run
from replay.show.plots.residual_strip import COLUMNS, FEW, column_means, residual_strip


def test_each_part_of_a_session_has_the_mean_of_its_usable_steps() -> None:
    run = made_run(masked=(0, 600))
    means = column_means(run, run.observed[2], COLUMNS)
    assert np.isnan(means[: COLUMNS // 4]).all()
    assert means[COLUMNS // 4 : COLUMNS // 2] == pytest.approx(-0.2)
    assert means[COLUMNS // 2 :] == pytest.approx(6.0)


def test_the_channel_that_is_furthest_off_is_the_first_row_and_the_finding() -> None:
    plot = residual_strip(many(CHANNELS), 100)
    assert plot is not None
    assert plot.title == "Furthest off: rotor surface, 4.1 K on average, the model too cold"
    assert plot.table.head[1] == "rotor surface T_3 [K]"
    assert plot.table.rows[0][1] == "–" and plot.table.rows[-1][1] == "+6.0"


def test_it_is_drawn_and_no_bitmap_which_the_pages_policy_would_not_load() -> None:
    plot = residual_strip(many(CHANNELS), 100)
    assert plot is not None and "<image" not in plot.svg and plot.svg.count("data-band") == 1
    few = made_run()
    assert len(few.observed) < FEW and residual_strip(few, 100) is None


def test_of_many_channels_the_ones_that_are_less_far_off_are_counted() -> None:
    plot = residual_strip(many(15), 100)
    assert plot is not None and "3 channels less far off not drawn" in plot.note
