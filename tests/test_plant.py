"""The independent truth is sound: it conserves energy, is resolved, repeats, and hides what it says and nothing
else."""

from __future__ import annotations

import ast
import json
from dataclasses import replace
from pathlib import Path

import can
import numpy as np
import pytest
from cantools.database.can import Database
from numpy.typing import NDArray

from plant import (
    CATALOGUE,
    Effect,
    Plant,
    Recording,
    drives,
    machine,
    placement,
    points,
    record,
    sessions,
    solver,
    typical,
    write_campaign,
)
from plant.effects import Hidden
from plant.geometry import NODES
from plant.mesh import CONDUCTS, RADIATES
from plant.plant import operate
from plant.reduction import loss_errors, reduce

Floats = NDArray[np.float64]

SEED = 11


@pytest.fixture(scope="module")
def designed() -> Plant:
    return Plant(0, roughness=0.0)


@pytest.fixture(scope="module")
def rough_drive() -> drives.Drive:
    """Fifteen minutes with everything in it: resonance, load, braking, standstill; at 2 Hz."""
    t = np.arange(1800) / 2.0
    speed = 6000.0 + 3500.0 * np.sin(2 * np.pi * t / 225.0)
    torque = np.where(np.sin(2 * np.pi * t / 150.0) > -0.6, 90.0, -60.0)
    speed[-60:] = torque[-60:] = 0.0
    return replace(drives.drive("rough", "drive", speed, torque, rate_hz=2.0), step_s=2.0)


@pytest.fixture(scope="module")
def healthy(rough_drive: drives.Drive) -> Recording:
    plant = Plant(SEED)
    return record(plant, plant.run(rough_drive, 1, start=_hot(plant, rough_drive)), "ten")


def _hot(plant: Plant, drive: drives.Drive) -> Floats:
    """The temperatures of the healthy motor at a hot point; what an effect adds starts at their mean."""
    hot = Plant(plant.seed).steady(drive, 6000.0, 75.0)
    return np.concatenate([hot, np.full(len(plant.mesh.cells) - len(hot), hot.mean())])


def _columns(recording: Recording) -> dict[str, Floats]:
    """Signal -> values, and the stamps of each message."""
    named = {f"t {block.message.name}": block.t_ns.astype(np.float64) for block in recording.blocks}
    for block in recording.blocks:
        named |= {signal[0]: block.values[:, k] for k, signal in enumerate(block.message.signals)}
    return named


def _changed(a: Recording, b: Recording) -> set[str]:
    one, other = _columns(a), _columns(b)
    return {name for name in one if not np.array_equal(one[name], other[name])}


def test_the_plant_imports_nothing_of_the_product() -> None:
    for path in (Path(__file__).parent / "plant").glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            strays = {name.split(".")[0] for name in names} & {"twin", "ingest", "replay", "analytics", "whyhot"}
            assert not strays, f"{path.name} imports {strays}"


# ---- physics -------------------------------------------------------------------------------------------------------


def test_the_mesh_has_the_nodes_of_the_motor_and_enough_cells(designed: Plant) -> None:
    assert {cell.node for cell in designed.mesh.cells} == {*NODES, ""}
    assert 120 <= len(designed.mesh.cells) <= 200
    assert 20_000 < designed.capacity.sum() < 35_000


def test_energy_in_a_run_closes() -> None:
    plant = Plant(SEED)
    truth = plant.run(drives.pulse(4000.0, 165.0, 30.0, 120.0))
    stored = float(plant.capacity @ (truth.temperatures[-1] - truth.temperatures[0]))
    step = float(truth.t_s[1])
    passed = float((truth.heat - truth.to_coolant - truth.to_ambient).sum()) * step
    assert stored == pytest.approx(passed, rel=1e-9)
    assert truth.heat.sum() * step > 50_000.0


def test_the_steady_state_equals_a_dense_solution_and_a_long_march(designed: Plant) -> None:
    row = drives.drive("held", "s1", np.full(7200, 6000.0), np.full(7200, 60.0), rate_hz=0.1)
    row = replace(row, step_s=10.0, inlet_degC=np.full(7200, 65.0), ambient_degC=np.full(7200, 25.0))
    steady = designed.steady(row, 6000.0, 60.0)
    system = designed.system()
    loads = designed.loads(system, row, operate(row, np.full(7200, 90.0)), 10.0)
    assert _dense(designed, system, loads, steady) == pytest.approx(steady, abs=1e-4)
    marched = solver.march(system, loads.first(2160), steady - 10.0, 10.0)
    assert marched.temperatures[-1] == pytest.approx(steady, abs=0.01)


def _dense(plant: Plant, system: solver.System, loads: solver.Loads, about: Floats) -> Floats:
    """The steady state from a dense matrix written out here; radiation and free convection at temperatures `about`."""
    n = system.n
    index, inlet_ambient = plant.mesh.index, loads.outside[0]
    every = np.concatenate([about, inlet_ambient])
    matrix, right = np.zeros((n, n)), np.zeros(n)
    films = dict(zip(system.films, loads.film[0], strict=True))
    for joint in plant.mesh.joints:
        a, b = index[joint.a], index[joint.b]
        kelvin = (every[a] + 273.15, every[b] + 273.15)
        if joint.kind == CONDUCTS:
            g = 1.0 / (joint.resistance + (1.0 / (joint.area * films[joint.film]) if joint.film else 0.0))
        elif joint.kind == RADIATES:
            g = 5.670374419e-8 * joint.area * (kelvin[0] ** 2 + kelvin[1] ** 2) * (kelvin[0] + kelvin[1])
        else:
            g = 1.9 * joint.area * (abs(kelvin[0] - kelvin[1]) + 0.01) ** 0.25
        for i, j in ((a, b), (b, a)):
            if i < n:
                matrix[i, i] += g
                if j < n:
                    matrix[i, j] -= g
                else:
                    right[i] += g * inlet_ambient[j - n]
    stations = [index[name] for name in plant.mesh.coolant]
    for before, here in zip([None, *stations[:-1]], stations, strict=True):
        matrix[here, here] += loads.stream[0]
        if before is None:
            right[here] += loads.stream[0] * inlet_ambient[0]
        else:
            matrix[here, before] -= loads.stream[0]
    hot = 1 + 0.00393 * (about - 20.0)
    right = right + (
        system.dc * loads.current2[0] * hot + loads.ac[0] / hot + loads.heat[0] * (1 + system.slope * (about - 100.0))
    )
    result: Floats = np.linalg.solve(matrix, right)
    return result


def test_half_the_step_and_a_finer_mesh_change_little(designed: Plant) -> None:
    pulse = drives.pulse(4000.0, 200.0, 10.0, 30.0)
    coarse, fine = (designed.run(pulse, step_s=step, start=designed.rest(pulse)) for step in (0.5, 0.1))
    assert np.abs(coarse.temperatures[::1] - fine.temperatures[::5]).max() < 0.05
    finer = Plant(0, roughness=0.0, axial=12)
    for node in NODES:
        means = [p.steady(pulse, 6000.0, 60.0)[p.mesh.of_node(node)].mean() for p in (designed, finer)]
        assert means[0] == pytest.approx(means[1], abs=2.0), node


def test_the_machine_makes_its_torque_within_current_and_voltage() -> None:
    speed = np.linspace(500.0, 16_000.0, 40)
    point = machine.operate(speed, np.full(40, 300.0), np.full(40, 100.0))
    made = 1.5 * 4 * (point.flux * 0 + machine.PSI_Wb + (machine.LD_H - machine._lq(point.i_q)) * point.i_d) * point.i_q
    assert made == pytest.approx(point.torque, rel=1e-3)
    assert point.torque[0] == pytest.approx(220.0, abs=6.0)
    assert (point.torque * speed * np.pi / 30).max() == pytest.approx(150e3, rel=0.1)
    assert point.current.max() < 451.0
    assert np.hypot(point.u_d, point.u_q).max() < 1.06 * machine.VOLTAGE_V
    assert point.i_d[-1] < -300.0


def test_copper_loss_at_standstill_is_that_of_direct_current(designed: Plant) -> None:
    truth = designed.run(drives.dc_check(3.0), start=np.full(len(designed.mesh.cells), 20.0))
    resistance = designed.system().dc.sum() / 3.0
    assert truth.heat[70] == pytest.approx(2.0 * resistance * drives.DC_A**2, rel=0.05)  # and a little ripple
    assert 0.009 < resistance < 0.016


# ---- drives --------------------------------------------------------------------------------------------------------


def test_the_drive_cycle_is_the_regulation_s() -> None:
    assert drives.wltc().sum() == pytest.approx(83758.6, abs=0.05)
    driven = drives.wltp(1)
    metres = driven.speed_rpm.sum() / drives.RATE_HZ * np.pi / 30 * 0.335 / 12.2
    assert metres == pytest.approx(23_266.0, rel=0.001)


def test_an_s1_point_reaches_the_limit_and_pulses_end_there() -> None:
    plant = Plant(SEED)
    held = points.s1(plant, 6000.0, 30.0, number=2)
    peak = points.hot_spot(plant, plant.run(held, 2).temperatures).max()
    assert peak == pytest.approx(180.0, abs=1.0)
    assert 30.0 < held.torque_Nm.max() < 150.0
    pulsed = points.s2(plant, 4000.0, 8.0, number=3)
    assert points.hot_spot(plant, plant.run(pulsed, 3).temperatures).max() < 182.0
    assert pulsed.torque_Nm.max() > 150.0


def test_an_oven_cycle_ends_above_the_class_limit(designed: Plant) -> None:
    truth = designed.run(drives.oven(seconds=6 * 3600.0))
    winding = truth.temperatures[:, designed.mesh.of_node("winding_a")].mean(axis=1)
    assert winding[0] == pytest.approx(25.0, abs=0.1)
    assert 180.0 < winding.max() < 230.0
    assert not truth.point.current.any()


# ---- seeds and effects ---------------------------------------------------------------------------------------------


def test_a_seed_repeats_to_the_bit_and_another_differs(rough_drive: drives.Drive, healthy: Recording) -> None:
    again = Plant(SEED)
    assert not _changed(healthy, record(again, again.run(rough_drive, 1, start=_hot(again, rough_drive)), "ten"))
    other = Plant(SEED + 1)
    assert "MAG" in _changed(healthy, record(other, other.run(rough_drive, 1), "ten"))


@pytest.mark.parametrize("hidden", CATALOGUE, ids=lambda hidden: hidden.cause)
def test_an_effect_changes_what_it_should_and_nothing_else(
    hidden: Hidden, rough_drive: drives.Drive, healthy: Recording
) -> None:
    effect = hidden.effects()[-1]
    plant = Plant(SEED, effect)
    truth = plant.run(rough_drive, 1, dose_h=100.0, start=_hot(plant, rough_drive))
    changed = _changed(healthy, record(plant, truth, "ten"))
    inputs = {"Speed", "Torque", "TorqueCommand", "Inlet", "Ambient", "Flow"}
    same_truth = np.array_equal(truth.temperatures[:, :182], healthy.truth.temperatures)
    allowed = {
        "input": {"current": {"Id", "Iq"}, "flow": {"Flow"}}.get(effect.place, set()),
        "boundary": {"Inlet"},
        "clock": {name for name in _columns(healthy) if name.startswith(("t Stator", "t Telemetry"))},
    }
    if effect.kind in allowed:
        assert same_truth
        assert changed == allowed[effect.kind]
    elif effect.kind == "sensor":
        assert same_truth
        assert changed
        assert not changed & {*inputs, "Id", "Iq", "Power"}
    else:
        assert not same_truth
        assert not changed & inputs
        assert changed & {
            "EW_A_inner",
            "EW_B_inner",
            "EW_A_outer",
            "EW_B_outer",
            "TC_teeth",
            "TC_yoke",
            "RS",
            "MAG",
        } or (effect.node == "bearing_a" and "TC_bearing_a" in changed)


def test_a_sensor_fault_stays_with_its_channel(rough_drive: drives.Drive, healthy: Recording) -> None:
    for cause, channels in (
        ("sensor.magnet.bias", {"MAG"}),
        ("sensor.endwinding_a_inner.lag", {"EW_A_inner"}),
        ("sensor.teeth.swap_yoke", {"TC_teeth", "TC_yoke"}),
    ):
        plant = Plant(SEED, typical(cause))
        shown = record(plant, plant.run(rough_drive, 1, start=_hot(plant, rough_drive)), "ten")
        assert _changed(healthy, shown) == channels


def test_a_cause_id_says_where_and_what_is_hidden() -> None:
    assert typical("unknown.spray").scored_as == "unknown"
    assert typical("unknown.spray").node == "endwinding_b_outer"
    winding = Effect("loss.winding.speed2_current2", 400.0)
    assert winding.nodes == ("winding_a", "winding_b")
    assert Effect("conductance.winding-teeth.scale", 0.7).links == (("winding_a", "teeth"), ("winding_b", "teeth"))
    assert len({hidden.cause for hidden in CATALOGUE}) == len(CATALOGUE)


@pytest.mark.parametrize(
    "cause", ["loss.magnet", "loss.crank.speed2", "heat.magnet.speed2", "loss.magnet.sped2", "unknown.x"]
)
def test_a_cause_that_cannot_be_hidden_is_refused(cause: str) -> None:
    with pytest.raises(ValueError, match="no cause this plant can hide"):
        Effect(cause, 1.0)


# ---- files ---------------------------------------------------------------------------------------------------------


def test_the_motor_file_is_an_honest_reduction(designed: Plant) -> None:
    reduced = reduce()
    assert tuple(reduced.capacities) == NODES
    assert sum(reduced.capacities.values()) == pytest.approx(designed.capacity.sum(), rel=1e-9)
    errors = loss_errors()
    assert max(errors.values()) < 0.4
    assert sum(error > 0.08 for error in errors.values()) >= 3
    copper = sum(terms[0].coefficient for node, terms in reduced.sources.items() if terms[0].copper)
    assert copper == pytest.approx(designed.system().dc.sum() * 450.0**2, rel=1e-9)


def test_a_thermocouple_near_the_end_reads_between_the_surface_and_the_end_plate(designed: Plant) -> None:
    """Of the motor as designed, in pulses with more magnet loss: not what the shares were made from."""
    shares = placement.weights("RS")
    assert set(shares) == {"rotor_surface", "end_plate_a"}
    assert sum(shares.values()) == pytest.approx(1.0)
    assert 0.1 < shares["end_plate_a"] < 0.5
    assert placement.weights("MAG") == {"magnet": 1.0}
    lossy = Plant(0, Effect("loss.magnet.speed2", 300.0), roughness=0.0)
    run = lossy.run(points.s2(lossy, 8000.0, 20.0)).temperatures[1200:]
    mesh = lossy.mesh

    def mean(node: str) -> Floats:
        cells = mesh.of_node(node)
        found: Floats = np.average(run[:, cells], axis=1, weights=mesh.capacity[cells])
        return found

    read = 0.7 * run[:, mesh.index["surface.1"]] + 0.3 * run[:, mesh.index["surface.0"]]
    mixed = sum(share * mean(node) for node, share in shares.items())
    assert np.abs(read - mixed).mean() < 0.7 * np.abs(read - mean("rotor_surface")).mean()


def test_a_log_reads_back_through_other_libraries_as_written(healthy: Recording, tmp_path: Path) -> None:
    paths = write_campaign(tmp_path, Plant(SEED), [healthy], ("blf", "asc"), "ten")
    database = Database()
    database.add_dbc_file(tmp_path / "bench.dbc")
    sent = {block.message.name: block for block in healthy.blocks}
    for path in paths:
        seen = dict.fromkeys(sent, 0)
        first, begin = None, min(int(block.t_ns[0]) for block in healthy.blocks)
        with can.LogReader(path) as log:
            for frame in log:
                first = frame.timestamp if first is None else first
                message = database.get_message_by_frame_id(frame.arbitration_id)
                block, k = sent[message.name], seen[message.name]
                if k % 100 == 0:
                    values = list(message.decode_simple(bytes(frame.data)).values())
                    assert values == pytest.approx(block.values[k, : len(values)].tolist(), abs=1e-6)
                    assert frame.timestamp - first == pytest.approx((block.t_ns[k] - begin) / 1e9, abs=5e-6)
                seen[message.name] += 1
        assert seen == {name: block.t_ns.size for name, block in sent.items()}


@pytest.mark.parametrize("form", ["csv", "csv_de"])
def test_a_logger_s_table_is_taken_in_too(form: str, healthy: Recording, tmp_path: Path) -> None:
    from replay.cli import main

    paths = write_campaign(tmp_path, Plant(SEED), [healthy], (form,), "ten")
    store, answer = ["--store", str(tmp_path / "store")], tmp_path / "in.json"
    assert main(["ingest", str(paths[0]), "--bench", str(tmp_path / "bench.toml"), *store, "--json", str(answer)]) == 0
    assert json.loads(answer.read_text())["schema"] == "whyhot.ingest/1"


def test_a_campaign_goes_through_ingest_and_replay(tmp_path: Path) -> None:
    from replay.cli import main

    plant = Plant(SEED)
    planned = [points.s2(plant, 4000.0, 20.0, 0), drives.wltp(1)]
    paths = write_campaign(tmp_path, plant, sessions(plant, planned))
    bench = ["--bench", str(tmp_path / "bench.toml"), "--dbc", str(tmp_path / "bench.dbc")]
    store = ["--store", str(tmp_path / "store")]
    assert main(["ingest", *map(str, paths), *bench, *store, "--json", str(tmp_path / "in.json")]) == 0
    assert main(["sessions", *store, "--json", str(tmp_path / "sessions.json")]) == 0
    assert main(["replay", *store, "--json", str(tmp_path / "replay.json")]) == 0
    kinds = {s["name"]: s["kind"] for s in json.loads((tmp_path / "sessions.json").read_text())["sessions"]}
    assert kinds == {"1_s2": "s2", "2_wltp": "wltp"}
    errors = [run["mae_K"] for run in json.loads((tmp_path / "replay.json").read_text())["runs"]]
    assert all(len(error) == 6 for error in errors)
    assert 0.5 < np.mean([value for error in errors for value in error.values()]) < 7.0
