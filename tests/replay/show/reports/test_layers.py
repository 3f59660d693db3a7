"""Layers for the rerun viewer, read back from their files."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ingest.facts.events import SessionRecorded
from made.channels import channel
from made.runs import STEP_NS, UTC_NS, made_run
from replay.engine.results.run import Filtered, Run
from replay.errors import ViewerError
from replay.show.reports import blueprint, layers

STEPS = 2400


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


def recorded(absolute: bool = True) -> SessionRecorded:
    start = UTC_NS if absolute else 0
    return SessionRecorded(
        session="5e551_s1",
        name="1_s1",
        kind="s1",
        kind_why="said in the bench file",
        specimen=None,
        batch=None,
        bench=None,
        configuration=None,
        attributes={},
        absolute=absolute,
        start_ns=start,
        end_ns=start + STEPS * STEP_NS,
        files=[],
    )


def channels(start_s: float = UTC_NS / 1e9) -> list[Any]:
    t_s = start_s + np.arange(STEPS)
    node: dict[str, Any] = {"role": "observed", "node": "winding", "region": "copper"}
    return [
        channel("T_1", "temperature", np.linspace(60, 80, STEPS), t_s=t_s, **node),
        channel("coolant / in", "temperature", np.full(STEPS, 60.0), t_s=t_s, node="coolant"),
        channel("speed", "speed", np.full(STEPS, 1500.0), t_s=t_s),
        channel("mode", "state", np.repeat([0.0, 1.0], STEPS // 2), t_s=t_s),
        channel("bearing", "temperature", np.full(STEPS, 40.0), t_s=t_s, role="ignored"),
        channel("never", "torque", np.array([])),
    ]


@pytest.fixture
def measured(tmp_path: Path) -> Path:
    pytest.importorskip("rerun")
    layers.write_measured(recorded(), channels(), tmp_path / "measured.rrd")
    return tmp_path / "measured.rrd"


@pytest.fixture
def modelled(tmp_path: Path) -> Path:
    pytest.importorskip("rerun")
    layers.write_open_loop(made_run(masked=(100, 400)), tmp_path / "open_loop.rrd")
    return tmp_path / "open_loop.rrd"


def test_measured_samples_come_back_at_their_own_time_and_value(measured: Path) -> None:
    t_ns, value = values(measured, "measured/winding/T_1", "Scalars:scalars")
    assert t_ns.tolist() == (UTC_NS + np.arange(STEPS) * STEP_NS).tolist()
    assert value == pytest.approx(np.linspace(60, 80, STEPS))


def test_boundaries_and_drives_are_inputs_by_quantity_and_empty_channels_are_left_out(measured: Path) -> None:
    paths = {entity(batch) for batch in chunks(measured)}
    assert {
        "inputs/temperature/coolant\\ \\/\\ in",
        "inputs/speed/speed",
        "ignored/temperature/bearing",
        "answer/recording",
    } <= paths
    assert not any("never" in path for path in paths)


def test_a_state_is_a_phase_with_its_changes_only(measured: Path) -> None:
    t_ns, state = values(measured, "phase/mode", "StateChange:state")
    assert state.tolist() == ["0", "1"]
    assert t_ns.tolist() == [UTC_NS, UTC_NS + STEPS // 2 * STEP_NS]


def test_the_open_loop_layer_holds_every_node_and_the_networks_heat(modelled: Path) -> None:
    run = made_run()
    for j, node in enumerate(run.nodes):
        t_ns, value = values(modelled, f"open_loop/9ac1f00d/{node}", "Scalars:scalars")
        assert t_ns.tolist() == run.t_ns.tolist()
        assert value == pytest.approx(run.temperatures[:, j])
    assert values(modelled, "heat/9ac1f00d", "Scalars:scalars")[1] == pytest.approx(run.losses_W)


def with_filter() -> Run:
    run = made_run()
    heat = np.linspace(20.0, 40.0, STEPS)
    made = Filtered(
        node="rotor_surface",
        measured=("T_1", "T_2"),
        temperatures=run.temperatures + 1.0,
        heat_W=heat,
        heat_sd_W=np.full(STEPS, 3.0),
        nominal_W=heat - 5.0,
        heat_walk_W=0.4,
        nis=1.0,
    )
    return replace(run, filtered=made)


def test_the_filtered_layer_holds_every_node_and_the_loss_with_its_band(tmp_path: Path) -> None:
    pytest.importorskip("rerun")
    run, file = with_filter(), tmp_path / "filtered.rrd"
    layers.write_filtered(run, file)
    for j, node in enumerate(run.nodes):
        assert values(file, f"filtered/9ac1f00d/{node}", "Scalars:scalars")[1] == pytest.approx(
            run.temperatures[:, j] + 1
        )
    heat = np.linspace(20.0, 40.0, STEPS)
    for name, watts in {"estimated": heat, "modelled": heat - 5, "from": heat - 6, "to": heat + 6}.items():
        t_ns, value = values(file, f"loss/9ac1f00d/rotor_surface/{name}", "Scalars:scalars")
        assert value == pytest.approx(watts), name
        assert t_ns.tolist() == run.t_ns[1:].tolist(), name


def test_a_run_without_a_filter_has_no_such_layer(tmp_path: Path) -> None:
    pytest.importorskip("rerun")
    with pytest.raises(ValueError, match="has no filter"):
        layers.write_filtered(made_run(), tmp_path / "filtered.rrd")


def test_an_extended_model_is_a_layer_of_its_own_over_the_one_before(tmp_path: Path) -> None:
    pytest.importorskip("rerun")
    run, file = made_run(model="e47e4ded" * 8), tmp_path / "extended.rrd"
    layers.write_open_loop(run, file, layer="extended", over=with_filter())
    assert values(file, "extended/e47e4ded/winding", "Scalars:scalars")[1] == pytest.approx(run.temperatures[:, 0])
    paths = {entity(batch) for batch in chunks(file)}
    assert {"residual/e47e4ded/winding/T_1", "heat/e47e4ded", "answer/e47e4ded"} <= paths
    assert not any(path.startswith("open_loop") for path in paths)


def test_residuals_of_an_extended_model_are_of_the_reading_as_recorded(tmp_path: Path) -> None:
    pytest.importorskip("rerun")
    run, file = made_run(model="e47e4ded" * 8), tmp_path / "extended.rrd"
    corrected = replace(run, observed=tuple(replace(o, measured=o.measured - 1.7) for o in run.observed))
    layers.write_open_loop(corrected, file, layer="extended", over=made_run())
    _, value = values(file, "residual/e47e4ded/rotor_surface/T_3", "Scalars:scalars")
    assert value == pytest.approx(run.observed[2].residual)


def test_the_layout_has_a_tab_for_the_estimated_loss_and_every_model_in_the_same_views() -> None:
    pytest.importorskip("rerun")
    both = shown(blueprint.of_run(with_filter(), made_run(model="e47e4ded" * 8)))
    plain = shown(blueprint.of_run(made_run()))
    assert "Estimated loss" in both
    assert "Estimated loss" not in plain
    rotor = both["rotor [°C]"]
    for layer in ("measured", "open_loop/9ac1f00d", "extended/e47e4ded", "filtered/9ac1f00d"):
        assert f"+ /{layer}/rotor_surface/**" in rotor
    assert plain["rotor [°C]"] == ["+ /measured/rotor_surface/**", "+ /open_loop/9ac1f00d/rotor_surface/**"]


def shown(layout: Any) -> dict[str, list[str]]:
    """Name of each container and view -> what a view shows."""
    found: dict[str, list[str]] = {}
    waiting = [layout.root_container]
    while waiting:
        part = waiting.pop()
        found[str(part.name)] = list(getattr(part, "contents", []) if hasattr(part, "origin") else [])
        waiting += [] if hasattr(part, "origin") else part.contents
    return found


def test_residuals_are_measured_minus_model_with_masked_steps_as_gaps(modelled: Path) -> None:
    run = made_run(masked=(100, 400))
    _, value = values(modelled, "residual/9ac1f00d/rotor_surface/T_3", "Scalars:scalars")
    assert np.isnan(value[100:400]).all()
    assert value[400:] == pytest.approx(run.observed[2].residual[400:])


def test_masked_stretches_are_told_as_a_state(modelled: Path) -> None:
    t_ns, state = values(modelled, "masked/9ac1f00d/T_3", "StateChange:state")
    assert state.tolist() == ["used", "masked", "used"]
    assert ((t_ns - UTC_NS) / 1e9).tolist() == [0.5, 100.5, 400.5]


def test_the_text_beside_the_plots_is_the_answer(modelled: Path) -> None:
    text = next(b["TextDocument:text"].flatten()[0].as_py() for b in chunks(modelled) if entity(b) == "answer/9ac1f00d")
    assert "The model is furthest off at the rotor surface" in text


def test_layers_of_a_session_lie_in_one_recording(measured: Path, modelled: Path) -> None:
    ids = {(b.application_id, b.recording_id) for file in (measured, modelled) for b in recordings(file)}
    assert ids == {("whyhot", "5e551_s1")}


def recordings(file: Path) -> list[Any]:
    return list(pytest.importorskip("rerun.chunk").RrdReader(file).recordings())


def test_both_layers_bring_a_layout(measured: Path, modelled: Path) -> None:
    for file in (measured, modelled):
        assert len(pytest.importorskip("rerun.chunk").RrdReader(file).blueprints()) == 1


def test_without_absolute_time_the_layers_count_from_the_start(tmp_path: Path) -> None:
    pytest.importorskip("rerun")
    layers.write_open_loop(made_run(absolute=False), tmp_path / "o.rrd")
    layers.write_measured(recorded(absolute=False), channels(0.0), tmp_path / "m.rrd")
    for file in (tmp_path / "o.rrd", tmp_path / "m.rrd"):
        names = {name for batch in chunks(file) for name in batch.schema.names}
        assert "since_start" in names and "time" not in names


def test_a_missing_viewer_is_one_line_that_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setitem(sys.modules, "rerun", None)
    monkeypatch.setattr(layers, "find_spec", lambda name: None)
    missing = r"^the rerun viewer is not installed: in a clone of whyhot, uv tool install '\.\[view,tdms,xlsx\]' \(or"
    with pytest.raises(ViewerError, match=missing):
        layers.write_measured(recorded(), channels(), tmp_path / "m.rrd")
    with pytest.raises(ViewerError, match=missing):
        layers.write_open_loop(made_run(), tmp_path / "o.rrd")
    with pytest.raises(ViewerError, match=missing):
        layers.view([tmp_path / "m.rrd"])


def viewer(tmp_path: Path, script: str) -> str:
    program = tmp_path / "rerun"
    program.write_text(f"#!/bin/sh\necho $@ >> {tmp_path / 'said'}\n[ $1 = analytics ] && exit 0\n{script}\n")
    program.chmod(0o755)
    return str(program)


@pytest.mark.skipif(sys.platform == "win32", reason="the stand-in for the viewer is a shell script")
def test_the_viewer_is_started_on_this_machine_only_with_its_statistics_off(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    program = viewer(tmp_path, "exit 0")
    monkeypatch.setattr(layers, "_program", lambda: program)
    layers.view([Path("a.rrd"), Path("b.rrd")])
    assert (tmp_path / "said").read_text().splitlines() == [
        "analytics disable",
        "--bind 127.0.0.1 --port auto a.rrd b.rrd",
    ]


@pytest.mark.skipif(sys.platform == "win32", reason="the stand-in for the viewer is a shell script")
def test_a_viewer_that_stops_at_once_is_refused_with_its_own_last_words(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    program = viewer(tmp_path, "echo first; echo neither WAYLAND_DISPLAY nor DISPLAY is set; exit 1")
    monkeypatch.setattr(layers, "_program", lambda: program)
    with pytest.raises(ViewerError, match=r"at once: neither WAYLAND_DISPLAY nor DISPLAY is set\. .* rerun a\.rrd$"):
        layers.view([Path("a.rrd")])
