"""Layers for the rerun viewer, read back from their files."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from made.channels import channel
from made.runs import STEP_NS, UTC_NS, made_run
from made.seen import EXTENDED, PUBLISHED, RECALIBRATED, STEPS, network, seen, seen_channels, seen_session
from replay.errors import ViewerError
from replay.show.plots.compare import MODELS
from replay.show.viewer import aligned, blueprint, program
from replay.show.viewer.layers import write_layers
from replay.show.viewer.seen import COLOUR, CORRECTED, MEASURED, SessionSeen, unit


def chunks(file: Path) -> list[Any]:
    reader = pytest.importorskip("rerun.chunk").RrdReader(file)
    return [chunk.to_record_batch() for chunk in reader.stream()]


def entity(batch: Any) -> str:
    return str(batch.schema.metadata[b"rerun:entity_path"].decode()).removeprefix("/")


def values(file: Path, path: str, column: str) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
    """Time [ns] and values of a column of an entity, in the order of time."""
    times, read = [], []
    for batch in chunks(file):
        timeline = {"time", "since_start"} & set(batch.schema.names)
        found = [name for name in batch.schema.names if name.endswith(column)]
        if entity(batch) == path and timeline and found:
            times.append(np.asarray(batch[timeline.pop()].cast("int64")))
            read.append(np.asarray(batch[found[0]].flatten()))
    return np.concatenate(times), np.concatenate(read)


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Layer -> file, of a session under three models."""
    pytest.importorskip("rerun")
    return {path.name.split(".")[1]: path for path in write_layers(seen(), tmp_path_factory.mktemp("layers"))}


def text_of(file: Path, where: str) -> str:
    return str(next(b["TextDocument:text"].flatten()[0].as_py() for b in chunks(file) if entity(b) == where))


def test_a_session_has_a_layer_for_each_of_its_models(written: dict[str, Path]) -> None:
    assert list(written) == ["measured", "open_loop", "recalibrated", "extended", "filtered", "network"]


def test_measured_samples_come_back_at_their_own_time_and_value(written: dict[str, Path]) -> None:
    t_ns, value = values(written["measured"], "measured/winding/T_1", "Scalars:scalars")
    assert t_ns.tolist() == (UTC_NS + np.arange(STEPS) * STEP_NS).tolist()
    assert value == pytest.approx(np.linspace(60, 80, STEPS))


def test_no_line_is_drawn_where_nothing_was_recorded(tmp_path: Path) -> None:
    pytest.importorskip("rerun")
    whole, *others = seen_channels()
    left = np.r_[0:1000, 1900:STEPS]
    holed = replace(
        whole, t_ns=whole.t_ns[left], value=whole.value[left], record=whole.record[left], raw=whole.raw[left]
    )
    holds = SessionSeen(seen_session(), [holed, *others], {"published": made_run()}, network())
    t_ns, value = values(write_layers(holds, tmp_path)[0], "measured/winding/T_1", "Scalars:scalars")
    (hole,) = np.flatnonzero(np.isnan(value))
    assert t_ns[hole - 1] < t_ns[hole] < t_ns[hole + 1] and value.size == left.size + 1


def test_what_was_not_replayed_is_told_beside_the_answer(tmp_path: Path) -> None:
    pytest.importorskip("rerun")
    run = made_run()
    run = replace(run, summary=replace(run.summary, note="0:51:00 to 1:30:00 replayed"))
    holds = SessionSeen(seen_session(), seen_channels(), {"published": run}, network())
    assert "0:51:00 to 1:30:00 replayed" in text_of(write_layers(holds, tmp_path)[0], "answer")


def test_boundaries_and_drives_are_inputs_by_quantity_and_empty_channels_are_left_out(written: dict[str, Path]) -> None:
    paths = {entity(batch) for batch in chunks(written["measured"])}
    assert {"inputs/temperature/coolant\\ \\/\\ in", "inputs/speed/speed", "ignored/temperature/bearing"} <= paths
    assert not any("never" in path for path in paths)


def test_a_state_is_a_phase_with_its_changes_only(written: dict[str, Path]) -> None:
    t_ns, state = values(written["measured"], "phase/mode", "StateChange:state")
    assert state.tolist() == ["0", "1"]
    assert t_ns.tolist() == [UTC_NS, UTC_NS + STEPS // 2 * STEP_NS]


def test_where_the_motor_turns_is_a_phase_and_short_stops_are_not_told(tmp_path: Path) -> None:
    pytest.importorskip("rerun")
    speed = np.full(STEPS, 1500.0)
    speed[300:304], speed[1000:1500] = 0.0, 0.0
    turning = channel("speed", "speed", speed, t_s=UTC_NS / 1e9 + np.arange(STEPS))
    (file,) = write_layers(SessionSeen(seen_session(), [turning]), tmp_path)
    t_ns, state = values(file, "phase/motor", "StateChange:state")
    assert state.tolist() == ["turns", "stands", "turns"]
    assert ((t_ns - UTC_NS) / 1e9).tolist() == [0, 1000, 1500]


@pytest.mark.parametrize(
    ("layer", "where"),
    [
        ("open_loop", f"open_loop/{PUBLISHED}"),
        ("recalibrated", f"open_loop/{RECALIBRATED}"),
        ("extended", f"extended/{EXTENDED}"),
    ],
)
def test_the_layer_of_a_model_holds_every_node_and_the_networks_heat(
    written: dict[str, Path], layer: str, where: str
) -> None:
    run = made_run()
    for j, node in enumerate(run.nodes):
        t_ns, value = values(written[layer], f"{where}/{node}", "Scalars:scalars")
        assert t_ns.tolist() == run.t_ns.tolist()
        assert value == pytest.approx(run.temperatures[:, j])
    model = where.split("/")[1]
    assert values(written[layer], f"heat/{model}", "Scalars:scalars")[1] == pytest.approx(run.losses_W)


def test_residuals_of_every_model_are_of_the_reading_as_recorded_with_masked_steps_as_gaps(
    written: dict[str, Path],
) -> None:
    residual = made_run().observed[2].residual
    _, first = values(written["open_loop"], f"residual/{PUBLISHED}/rotor_surface/T_3", "Scalars:scalars")
    assert np.isnan(first[100:400]).all()
    assert first[400:] == pytest.approx(residual[400:])
    _, last = values(written["extended"], f"residual/{EXTENDED}/rotor_surface/T_3", "Scalars:scalars")
    assert last == pytest.approx(residual)


@pytest.mark.parametrize(
    ("layer", "model"), [("open_loop", PUBLISHED), ("recalibrated", RECALIBRATED), ("extended", EXTENDED)]
)
def test_the_lines_above_are_as_far_apart_as_the_residual_below_says(
    written: dict[str, Path], layer: str, model: str
) -> None:
    for o in made_run().observed:
        _, reads = values(written[layer], f"reads/{model}/{o.node}/{o.channel}", "Scalars:scalars")
        _, left = values(written[layer], f"residual/{model}/{o.node}/{o.channel}", "Scalars:scalars")
        apart = o.measured - reads
        there = np.isfinite(left)
        assert there.sum() > len(left) / 2 and apart[there] == pytest.approx(left[there])


def test_the_corrected_reading_is_drawn_beside_the_recorded_one(written: dict[str, Path]) -> None:
    _, value = values(written["extended"], f"corrected/{EXTENDED}/winding/T_1", "Scalars:scalars")
    assert value == pytest.approx(made_run().observed[0].measured - 1.7)
    assert not [batch for batch in chunks(written["open_loop"]) if entity(batch).startswith("corrected")]


def test_a_residual_has_a_zero_line_and_the_sensors_band(written: dict[str, Path]) -> None:
    floor_K = made_run().observed[0].floor_K
    for name, value in {"zero": 0.0, "from": -floor_K, "to": floor_K}.items():
        t_ns, line = values(written["open_loop"], f"band/winding/T_1/{name}", "Scalars:scalars")
        assert line == pytest.approx([value, value])
        assert (t_ns[1] - t_ns[0]) / 1e9 == STEPS - 1


def test_masked_stretches_are_told_as_a_state(written: dict[str, Path]) -> None:
    t_ns, state = values(written["open_loop"], f"masked/{PUBLISHED}/T_3", "StateChange:state")
    assert state.tolist() == ["used", "masked", "used"]
    assert ((t_ns - UTC_NS) / 1e9).tolist() == [0.5, 100.5, 400.5]


def test_what_happened_is_told_at_its_moment(tmp_path: Path) -> None:
    pytest.importorskip("rerun")
    run = replace(made_run(), limits_degC={"winding": 70.0})
    files = write_layers(SessionSeen(seen_session(), seen_channels(), {"published": run}), tmp_path)
    t_ns, text = values(files[1], "event", "TextLog:text")
    above = int(np.argmax(run.temperatures[:, 0] > 70.0))
    assert "winding above its limit of 70 °C" in text[t_ns == run.t_ns[above]][0]
    assert [line for line in text if "rotor surface +6.0 K, the worst of T_3" in line]


def test_the_filtered_layer_holds_every_node_and_the_loss_with_its_band(written: dict[str, Path]) -> None:
    run, file = made_run(), written["filtered"]
    for j, node in enumerate(run.nodes):
        temperature = values(file, f"filtered/{PUBLISHED}/{node}", "Scalars:scalars")[1]
        assert temperature == pytest.approx(run.temperatures[:, j] + 1)
    heat = np.linspace(20.0, 40.0, STEPS)
    for name, watts in {"estimated": heat, "modelled": heat - 5, "from": heat - 6, "to": heat + 6}.items():
        t_ns, value = values(file, f"loss/{PUBLISHED}/rotor_surface/{name}", "Scalars:scalars")
        assert value == pytest.approx(watts), name
        assert t_ns.tolist() == run.t_ns[1:].tolist(), name


def test_nodes_of_graph_and_cut_take_the_colour_of_their_temperature(written: dict[str, Path]) -> None:
    _, graph = values(written["network"], "network", "GraphNodes:colors")
    _, labels = values(written["network"], "network", "GraphNodes:labels")
    _, rotor = values(written["network"], "cut/rotor_surface", "Mesh3D:albedo_factor")
    by_name = dict(zip([str(label).rsplit(" ", 2)[0] for label in labels[:4]], graph[-4:], strict=True))
    assert by_name["rotor surface"] == rotor[-1], "the same in both"
    assert str(labels[-2]) == f"rotor surface {made_run().temperatures[-1, 2]:.0f} °C"
    assert rotor[0] != rotor[-1] and by_name["winding"] != by_name["rotor surface"]


def test_the_motor_has_its_colours_from_the_first_sample_on_where_the_viewer_opens(tmp_path: Path) -> None:
    pytest.importorskip("rerun")
    early = replace(seen_session(), start_ns=UTC_NS - 300_000_000)
    *_, file = write_layers(SessionSeen(early, seen_channels(), {"published": made_run()}, network()), tmp_path)
    for where, what in (("network", "GraphNodes:labels"), ("cut/rotor_surface", "Mesh3D:albedo_factor")):
        assert values(file, where, what)[0][0] == early.start_ns


def test_units_are_as_people_write_them() -> None:
    assert [unit(channel("q", quantity, np.zeros(2)).spec) for quantity in ("flow", "temperature")] == ["l/min", "°C"]


def test_every_layer_carries_the_same_text_and_one_recording_and_layout(written: dict[str, Path]) -> None:
    reader = pytest.importorskip("rerun.chunk").RrdReader
    for file in written.values():
        assert text_of(file, "answer") == "**The cause.**"
        assert len(reader(file).blueprints()) == 1
        assert {(r.application_id, r.recording_id) for r in reader(file).recordings()} == {("whyhot", "5e551_s1")}


def test_without_a_diagnosis_the_text_says_what_the_replay_got_wrong_or_what_was_recorded(tmp_path: Path) -> None:
    pytest.importorskip("rerun")
    replayed = SessionSeen(seen_session(), seen_channels(), {"published": made_run()})
    assert "The model is furthest off at the rotor surface" in text_of(write_layers(replayed, tmp_path)[0], "answer")
    bare = SessionSeen(seen_session(), seen_channels())
    assert "- T_1: temperature, 2,400 samples" in text_of(write_layers(bare, tmp_path)[0], "answer")


def test_without_absolute_time_the_layers_count_from_the_start(tmp_path: Path) -> None:
    pytest.importorskip("rerun")
    for file in write_layers(seen(absolute=False), tmp_path):
        names = {name for batch in chunks(file) for name in batch.schema.names}
        assert "time" not in names
        assert "since_start" in names


def shown(layout: Any) -> dict[str, list[str]]:
    """Name of each container and view -> what a view shows."""
    found: dict[str, list[str]] = {}
    waiting = [layout.root_container]
    while waiting:
        part = waiting.pop()
        found[str(part.name)] = list(getattr(part, "contents", []) if hasattr(part, "origin") else [])
        waiting += [] if hasattr(part, "origin") else part.contents
    return found


def test_a_panel_is_a_node_with_every_model_and_no_legend_lies_over_it() -> None:
    pytest.importorskip("rerun")
    layout = blueprint.of(seen())
    views = shown(layout)
    rotor = views["Rotor surface [°C]"]
    for layer in ("measured", *(f"reads/{model}" for model in (PUBLISHED, RECALIBRATED, EXTENDED))):
        assert f"+ /{layer}/rotor_surface/**" in rotor
    assert {"network, with the cause", "motor cut open, with the cause", "loss of the rotor surface [W]"} <= set(views)
    assert not series_with_a_legend(layout)


def test_a_node_without_a_channel_is_shown_by_its_temperature() -> None:
    pytest.importorskip("rerun")
    one = seen()
    few = {role: replace(run, observed=run.observed[:1]) for role, run in one.runs.items()}
    views = shown(blueprint.of(replace(one, runs=few)))
    contents = {content for view in views.values() for content in view}
    for layer in (f"open_loop/{PUBLISHED}", f"open_loop/{RECALIBRATED}", f"extended/{EXTENDED}"):
        assert f"+ /{layer}/rotor_surface/**" in contents


def series_with_a_legend(layout: Any) -> list[str]:
    """Names of the plots over time that show one."""
    import rerun.blueprint as rrb

    waiting, found = [layout.root_container], []
    while waiting:
        part = waiting.pop()
        if isinstance(part, rrb.TimeSeriesView):
            legend: Any = part.properties["PlotLegend"]
            found += [str(part.name)] * bool(legend.visible is None or legend.visible.as_arrow_array()[0].as_py())
        waiting += [] if hasattr(part, "origin") else part.contents
    return found


def test_the_node_that_is_furthest_off_comes_first_and_a_colour_is_a_model() -> None:
    assert seen().observed[0] == "rotor_surface"
    models = {MODELS[role].label: COLOUR[role] for role in ("published", "recalibrated", "extended")}
    assert seen().key == {"measured": MEASURED, **models, "measured, as corrected": CORRECTED}


def test_aligned_sessions_count_from_their_starts_or_from_where_they_were_driven_alike(tmp_path: Path) -> None:
    pytest.importorskip("rerun")
    first, second = (driven(name, later_s) for name, later_s in (("one", 0), ("two", 500)))
    starts = {way: times_of(aligned.write_aligned([first, second], way, tmp_path / way)) for way in ("start", "test")}
    assert starts["start"] == {"one": 0.0, "two": 0.0}
    assert starts["test"] == {"one": 0.0, "two": -500.0}


def test_aligned_the_model_is_drawn_as_the_sensor_would_read_it(tmp_path: Path) -> None:
    """A sensor may read otherwise than its node is: the line above and the residual below are of one reading."""
    pytest.importorskip("rerun")
    one = seen()
    assert one.last
    role, run = one.last
    moved = replace(run, observed=tuple(replace(o, modelled=o.modelled - 3.0) for o in run.observed))
    file = aligned.write_aligned([replace(one, runs={role: moved})], "start", tmp_path)
    o = moved.observed[0]
    _, drawn = values(file, f"node/{o.node}/{one.session.name}/{o.channel}/model", "Scalars:scalars")
    assert drawn == pytest.approx(o.modelled)


def test_aligned_residuals_have_zero_and_the_sensors_bands_and_each_sessions_phases_stand_below(tmp_path: Path) -> None:
    pytest.importorskip("rerun")
    run, late = made_run(masked=(100, 400)), driven("late", 500)
    one = replace(driven("one", 0), runs={"published": run})
    file = aligned.write_aligned([one, late], "start", tmp_path)
    o = run.observed[0]
    for end, value in {"zero": 0.0, "from": -o.floor_K, "to": o.floor_K}.items():
        t_ns, drawn = values(file, f"band/{o.node}/one/{o.channel}/{end}", "Scalars:scalars")
        assert drawn == pytest.approx([value, value])
        assert t_ns[0] == o.t_ns[0] - one.session.start_ns
    for name, begins in (("one", 0.0), ("late", 500.0)):
        at, states = values(file, f"phase/{name}/motor", "StateChange:state")
        assert list(states[:2]) == ["stands", "turns"]
        assert at[1] / 1e9 == pytest.approx(begins + 500.0)
    off = next(one.channel for one in run.observed if not one.used.all())
    assert list(values(file, f"masked/one/{off}", "StateChange:state")[1]) == ["used", "masked", "used"]
    views = shown(aligned._layout([one, late]))
    assert any(content.startswith("+ /band/") for content in views["measured − model [K]"])
    assert "+ /phase/**" in views["phases and masked samples"]


def test_the_cycles_of_a_session_are_laid_over_one_another_each_with_its_part_of_the_replay(tmp_path: Path) -> None:
    """Twelve heatings of 200 s each, of which seven are shown."""
    pytest.importorskip("rerun")
    t_s = UTC_NS / 1e9 + np.arange(2400)
    oven = 20.0 + 100.0 * (np.arange(2400) % 200 >= 100)
    own = channel("T_1", "temperature", oven, t_s=t_s, role="observed", node="winding")
    session = replace(seen_session(), name="oven", kind="ageing")
    file = aligned.write_aligned([SessionSeen(session, [own], {"published": made_run()})], "cycle", tmp_path)
    assert file.name == "oven by cycle.rrd"
    assert "oven_cycle_12, each from its start, 7 of 12.**" in text_of(file, "answer")
    at, drawn = values(file, "node/winding/oven_cycle_3/T_1", "Scalars:scalars")
    assert at[0] == 0 and at[-1] == 199_000_000_000 and drawn[[0, 1, -1]].tolist() == [20.0, 120.0, 20.0]
    node = made_run().observed[0].node
    at, _ = values(file, f"node/{node}/oven_cycle_3/{made_run().observed[0].channel}/model", "Scalars:scalars")
    assert 0 <= at[0] < STEP_NS and 199 * STEP_NS <= at[-1] < 200 * STEP_NS


def test_a_session_without_cycles_is_refused_with_another_way(tmp_path: Path) -> None:
    pytest.importorskip("rerun")
    for kind, value in (
        ("s1", 80.0 + np.zeros(600)),
        ("ageing", np.linspace(60.0, 80.0, 600)),
        ("ageing", np.zeros(0)),
    ):
        own = channel("T_1", "temperature", value, t_s=UTC_NS / 1e9 + np.arange(len(value)))
        one = SessionSeen(replace(seen_session(), kind=kind), [own])
        with pytest.raises(ViewerError, match=f"1_s1 .{kind}. repeats nothing.*--align start"):
            aligned.write_aligned([one], "cycle", tmp_path)


def driven(name: str, later_s: int) -> SessionSeen:
    """A session of an hour in which the same speeds are driven `later_s` after its start."""
    t_s = UTC_NS / 1e9 + np.arange(3600)
    speed = np.repeat([0.0, 1000.0, 3000.0, 500.0, 2000.0, 0.0], 500)
    whole = np.concatenate([np.zeros(later_s), speed, np.zeros(3600)])[:3600]
    torque = np.where(whole > 0, 50.0, 0.0)
    own = [
        channel("speed", "speed", whole, t_s=t_s),
        channel("torque", "torque", torque, t_s=t_s),
        channel("T_1", "temperature", 60 + whole / 100, t_s=t_s, role="observed", node="winding"),
    ]
    return SessionSeen(replace(seen_session(), name=name, session=f"5e55{name}"), own)


def times_of(file: Path) -> dict[str, float]:
    """Session -> when its first sample is [s]."""
    return {name: values(file, f"node/winding/{name}/T_1", "Scalars:scalars")[0][0] / 1e9 for name in ("one", "two")}


def test_sessions_that_were_never_driven_alike_are_refused_in_one_line(tmp_path: Path) -> None:
    pytest.importorskip("rerun")
    bare = replace(driven("two", 0), channels=driven("two", 0).channels[2:])
    with pytest.raises(ViewerError, match=r"^--align test: one and two have no speed or load in common: --align start"):
        aligned.write_aligned([driven("one", 0), bare], "test", tmp_path)


def test_a_missing_viewer_is_one_line_that_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setitem(sys.modules, "rerun", None)
    monkeypatch.setattr(program, "find_spec", lambda name: None)
    missing = r"^the rerun viewer is not installed: in a clone of whyhot, uv tool install '\.\[view,.*xlsx\]' \(or"
    with pytest.raises(ViewerError, match=missing):
        write_layers(seen(), tmp_path)
    with pytest.raises(ViewerError, match=missing):
        program.view([tmp_path / "m.rrd"])
