"""Thinning, cells, and the pictures drawn from them."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from made.runs import made_run
from replay.show.plots.cells import ENOUGH_S, in_cells, pool_by_node, round_centres, round_edges
from replay.show.plots.error_maps import error_along, error_map
from replay.show.plots.plots import groups, inputs_over_time, over_time, picture
from replay.show.words.palette import SERIES, variables
from replay.show.words.thin import thin, with_gaps


def test_thinning_keeps_every_extreme_and_both_ends_of_a_long_series() -> None:
    t = np.arange(100_000.0)
    y = np.sin(t / 3000)
    y[54_321], y[77_777] = 40.0, -40.0
    short_t, short_y = thin(t, y, 500)
    assert short_t.size <= 1000
    assert short_t[short_y == 40.0] == 54_321
    assert short_t[short_y == -40.0] == 77_777
    assert (np.diff(short_t) > 0).all()


def test_a_thinned_line_begins_and_ends_where_the_series_does() -> None:
    t = np.arange(100_000.0)
    short_t, short_y = thin(t, np.sin(t / 50), 100)
    assert (short_t[0], short_t[-1], short_y[0]) == (0.0, 99_999.0, 0.0)


def test_a_table_has_a_dash_where_a_channel_has_no_sample() -> None:
    run = made_run()
    whole, ends = run.observed[0], run.observed[1]
    early = {
        name: getattr(ends, name)[:1200]
        for name in ("t_ns", "measured", "modelled", "used", "first_record", "last_record", "raw")
    }
    table = over_time(
        replace(run, observed=(replace(ends, **early), whole)), [replace(ends, **early), whole], 100
    ).table
    assert float(table.rows[-1][0]) == pytest.approx(40.0, abs=0.02), "as long as the one that goes on"
    assert table.rows[-1][1:4] == ("–", "–", "–") and "–" not in table.rows[0] + table.rows[-1][4:]


def test_a_channel_whose_name_ends_in_its_unit_has_that_once() -> None:
    run = made_run()
    both = [replace(run.observed[0], channel=f"TC_{i} [degC]") for i in range(2)]
    channels = [replace(run.summary.channels[0], channel=one.channel) for one in both]
    run = replace(run, observed=tuple(both), summary=replace(run.summary, channels=channels))
    plot = over_time(run, both, 100)
    assert plot.table.head[1] == "TC_0 measured [°C]"
    assert 'data-line="TC_1 model [°C]"' in plot.svg


def test_a_short_series_is_not_thinned() -> None:
    t, y = np.arange(10.0), np.arange(10.0)
    assert thin(t, y, 5)[0] is t


def test_a_masked_stretch_stays_a_gap_after_thinning() -> None:
    t, y, used = np.arange(10_000.0), np.ones(10_000), np.ones(10_000, dtype=bool)
    used[4000:5000] = False
    short_t, short_y = thin(*with_gaps(t, y, used), 100)
    inside = (short_t >= 4000) & (short_t < 5000)
    assert np.isnan(short_y[inside]).all() and inside.any()
    assert np.isfinite(short_y[~inside]).all()


def test_a_series_without_a_single_usable_sample_thins_to_gaps() -> None:
    t = np.arange(1000.0)
    assert np.isnan(thin(t, np.full(1000, np.nan), 10)[1]).all()


def test_a_hole_in_time_becomes_a_gap() -> None:
    t = np.r_[np.arange(100.0), np.arange(200.0, 300.0)]
    gapped_t, gapped_y = with_gaps(t, np.ones(200), np.ones(200, dtype=bool))
    assert gapped_t[np.isnan(gapped_y)].tolist() == [149.5]


@pytest.mark.parametrize(
    ("smallest", "largest", "step"),
    [(0.0, 3990.0, 1000.0), (21.0, 66.0, 10.0), (0.0, 16000.0, 2500.0), (0.0, 0.0, 0.2)],
)
def test_cells_have_round_edges_that_hold_every_value(smallest: float, largest: float, step: float) -> None:
    made = round_edges(smallest, largest, 5)
    assert np.diff(made) == pytest.approx(step)
    assert made[0] <= smallest and made[-1] >= largest


@pytest.mark.parametrize(("largest", "step"), [(4003.0, 1000.0), (285.0, 50.0), (0.0, 0.2)])
def test_operating_cells_lie_around_round_numbers(largest: float, step: float) -> None:
    made = round_centres(largest, 5)
    assert made[:2] == pytest.approx([0.0, step / 2])
    assert np.diff(made[1:]) == pytest.approx(step)
    assert made[-1] >= largest


def test_the_map_holds_the_mean_error_of_each_operating_cell_weighted_by_time() -> None:
    pool = pool_by_node([made_run(), made_run("2_s2", 1200)], ("speed_rpm", "current_A"))["rotor_surface"]
    cells = in_cells(
        pool, pool.inputs["speed_rpm"], pool.inputs["current_A"], np.array([0.0, 2000, 4000]), np.array([0.0, 200])
    )
    assert cells.mean[:, 0] == pytest.approx([-0.2, 6.0])
    assert cells.seconds.sum() == pytest.approx(3600)


def test_masked_samples_do_not_count_in_the_map() -> None:
    pool = pool_by_node([made_run(masked=(0, 1000))])["rotor_surface"]
    assert pool.seconds.sum() == pytest.approx(1400)


def test_a_cell_with_little_data_says_nothing() -> None:
    pool = pool_by_node([made_run(steps=int(ENOUGH_S))], ("speed_rpm", "current_A"))["winding"]
    cells = in_cells(
        pool, pool.inputs["speed_rpm"], pool.inputs["current_A"], np.array([0.0, 2000, 4000]), np.array([0.0, 200])
    )
    assert np.isnan(cells.mean).all() and (cells.seconds > 0).all()


def test_the_map_title_names_the_worst_node_cell_and_direction() -> None:
    plot = error_map([made_run()])
    assert plot is not None
    assert plot.title == "Rotor surface: model 6.0 K too cold at 3,250 to 3,750 rpm and 112.5 to 137.5 A current"
    assert plot.table.rows[0][0] == "rotor surface"


def test_a_model_that_is_right_is_not_called_too_cold_by_nothing() -> None:
    run = made_run()
    for one in run.observed:
        one.measured[:] = one.modelled + 0.01
    for plot in (error_map([run]), error_along([run])):
        assert plot is not None and ": model within 0.05 K everywhere, worst " in plot.title


def test_the_number_of_the_cell_at_standstill_does_not_lie_over_the_axis() -> None:
    run = made_run()
    run.inputs["speed_rpm"][:600] = 0.0
    plot = error_map([run])
    assert plot is not None
    middles = re.findall(r'middle[^>]* x="([\d.]+)"[^>]*>0</text>', plot.svg)
    numbers = re.findall(r' x="([\d.]+)"[^>]*>−0\.2</text>', plot.svg)
    assert float(middles[0]) == pytest.approx(min(map(float, numbers)), abs=0.1), "above the tick of 0"


def test_the_error_along_a_long_session_is_over_hours_as_its_plots_over_time_are() -> None:
    hours = error_along([made_run(steps=4 * 3600), made_run()])
    assert hours is not None and "time since start [h]" in hours.svg


def test_cells_are_told_as_they_are() -> None:
    run = made_run(steps=6000)
    for one in run.observed:
        one.measured[:] = np.linspace(-30.0, -5.0, 6000)
        one.modelled[:] = one.measured - 1.0
    plot = error_along([run])
    assert plot is not None and [row[0] for row in plot.table.rows][:2] == ["−30 to −27.5", "−27.5 to −25"]


def test_there_is_no_map_where_no_load_was_recorded() -> None:
    run = made_run()
    del run.inputs["current_A"]  # type: ignore[attr-defined]
    assert error_map([run]) is None


def test_a_session_too_short_for_any_cell_has_no_plot_of_cells() -> None:
    short = made_run(steps=int(ENOUGH_S) - 1)
    assert error_map([short]) is None and error_along([short]) is None


def test_a_map_without_a_cell_of_enough_data_is_left_out() -> None:
    plot = error_map([made_run(masked=(10, 2400))])
    assert plot is not None
    assert "Rotor surface" not in plot.svg and "Winding" in plot.svg


def test_a_panel_without_a_cell_of_enough_data_is_left_out() -> None:
    both = error_along([made_run()])
    brief = error_along([made_run(steps=300)])  # 25 s a cell of time
    assert both is not None and "time since start" in both.svg and "measured temperature" in both.svg
    assert brief is not None and "time since start" not in brief.svg and "measured temperature" in brief.svg


def test_no_tick_of_an_axis_loses_the_digit_that_tells_it_from_the_next() -> None:
    run = made_run()
    run.inputs["current_A"][:] = np.linspace(70.6, 71.4, run.inputs["current_A"].size)
    run.inputs["speed_rpm"][:] = np.linspace(-4000.0, 4000.0, run.inputs["speed_rpm"].size)
    plot = inputs_over_time(run, 600)
    assert plot is not None
    assert re.findall(r">(7[01][.\d]*)</text>", plot.svg) == ["70.75", "71", "71.25"]
    assert ">−2,500</text>" in plot.svg


def test_an_input_without_a_value_has_no_panel() -> None:
    run = made_run()
    run.inputs["current_A"][:] = np.nan
    plot = inputs_over_time(run, 600)
    assert plot is not None and plot.title == "What drove it: speed and boundaries"


def test_the_error_along_temperature_names_the_worst_node() -> None:
    plot = error_along([made_run()])
    assert plot is not None
    assert plot.title.startswith("Rotor surface: model 6.0 K too cold when it is at ")


def test_channels_are_grouped_by_region_and_unusable_ones_left_out() -> None:
    assert [[o.node for o in group] for group in groups(made_run())] == [["winding"], ["stator"], ["rotor_surface"]]
    assert [[o.node for o in group] for group in groups(made_run(masked=(0, 2400)))] == [["winding"], ["stator"]]


def test_a_plot_over_time_says_the_finding_and_carries_its_data() -> None:
    run = made_run(masked=(100, 400))
    plot = over_time(run, groups(run)[2], 600)
    assert plot.title == "Rotor surface: model 3.5 K too cold on average, worst at 3,200 to 3,500 rpm"
    assert plot.table.head[1:] == (
        "rotor surface measured [°C]",
        "rotor surface model [°C]",
        "rotor surface difference [K]",
    )
    assert {row[3] for row in plot.table.rows} == {"masked", "−0.2", "+6.0"}


def test_of_several_sensors_of_a_node_a_title_names_its_own() -> None:
    run = made_run()
    twins = [replace(one, channel=f"{one.channel}b") for one in run.observed if one.node == "rotor_surface"]
    errors = [replace(one, channel=f"{one.channel}b") for one in run.summary.channels if one.node == "rotor_surface"]
    summary = replace(run.summary, channels=[*run.summary.channels, *errors])
    both = replace(run, observed=(*run.observed, *twins), summary=summary)
    plot = over_time(both, twins, 600)
    assert plot.title.startswith("Rotor surface (T_3b): model 3.1 K too cold")
    assert plot.table.head[1] == "T_3b measured [°C]", "the other one stands in another panel"


def test_a_drawing_is_well_formed_and_takes_its_colours_from_the_page() -> None:
    run = made_run()
    svg = over_time(run, groups(run)[0], 600).svg
    ElementTree.fromstring(svg)
    assert "var(--blue)" in svg and "var(--ink)" in svg
    used = set(re.findall(r"var\((--\w+)\)", svg))
    assert used <= set(variables(dark=False)) == set(variables(dark=True))
    assert not any(light in svg for light, _ in SERIES.values())


def test_the_inputs_are_shown_with_their_units() -> None:
    plot = inputs_over_time(made_run(), 600)
    assert plot is not None
    assert plot.title == "What drove it: speed, current and boundaries"
    assert plot.table.head[1:] == ("speed [rpm]", "current [A]", "coolant [°C]")


def test_the_picture_is_the_worst_session_as_svg_and_png(tmp_path: Path) -> None:
    mild = made_run("mild", masked=(1200, 2400))
    picture([mild, made_run("2_s2")], tmp_path / "replay.svg")
    svg = (tmp_path / "replay.svg").read_text()
    assert "session 2_s2" in svg and "Rotor surface: model" in svg
    assert (tmp_path / "replay.png").read_bytes().startswith(b"\x89PNG")


def test_drawing_twice_gives_the_same_bytes(tmp_path: Path) -> None:
    for name in ("a", "b"):
        picture([made_run()], tmp_path / name)
    assert (tmp_path / "a.svg").read_bytes() == (tmp_path / "b.svg").read_bytes()
