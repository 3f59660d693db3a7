"""Every form of the plant is a believable motor, and every cause of the catalogue can be hidden in it."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from plant import CATALOGUE, Effect, Plant, Recording, drives, losses, machine, points, record, solver
from plant.effects import KINDS, UNKNOWN
from plant.forms import FORMS, SECTION, WEAKENED, Form
from plant.geometry import BOUNDARIES, NODES, RHO_COPPER_20
from plant.losses import HEATS, LossLaws
from plant.plant import operate

Floats = NDArray[np.float64]

SEED = 11
each_form = pytest.mark.parametrize("form", FORMS.values(), ids=list(FORMS))


@cache
def designed(form: Form) -> Plant:
    return Plant(0, roughness=0.0, form=form)


@cache
def at_rated_point(form: Form) -> tuple[Floats, solver.Solution]:
    """Temperatures (n,) of the motor as designed at its rated point, and two minutes more of it."""
    plant = designed(form)
    rpm, torque = (np.full(1200, value) for value in form.rated)
    held = drives.drive("held", "s1", rpm, torque)
    held = replace(held, inlet_degC=np.full(1200, 65.0), ambient_degC=np.full(1200, 25.0))
    loads = plant.loads(plant.system(), held, operate(held, np.full(1200, 90.0), form.machine), 1.0)
    steady = plant.steady(held, *form.rated)
    return steady, solver.march(plant.system(), loads, steady, 1.0)


@cache
def rough_drive(form: Form) -> drives.Drive:
    """Fifteen minutes with everything in it: resonance, load, braking, standstill; at 2 Hz."""
    t = np.arange(1800) / 2.0
    top, most = form.machine.top_rpm, form.machine.torque_Nm
    speed = top * (0.375 + 0.22 * np.sin(2 * np.pi * t / 225.0))
    torque = most * np.where(np.sin(2 * np.pi * t / 150.0) > -0.6, 0.42, -0.27)
    speed[-60:] = torque[-60:] = 0.0
    return replace(drives.drive("rough", "drive", speed, torque, rate_hz=2.0), step_s=2.0)


def recorded(form: Form, *effects: Effect) -> Recording:
    """Session 1 of a specimen, from a hot start that does not depend on what it hides."""
    driven, plant = rough_drive(form), Plant(SEED, *effects, form=form)
    hot = Plant(SEED, form=form).steady(driven, *form.rated)
    start = np.concatenate([hot, np.full(len(plant.mesh.cells) - len(hot), hot.mean())])
    return record(plant, plant.run(driven, 1, dose_h=100.0, start=start), "ten")


@cache
def healthy(form: Form) -> Recording:
    return recorded(form)


# ---- physics -------------------------------------------------------------------------------------------------------


@each_form
def test_a_form_has_the_nodes_and_boundaries_of_every_motor_file(form: Form) -> None:
    mesh = designed(form).mesh
    assert {cell.node for cell in mesh.cells} == {*NODES, ""}
    assert len({cell.name for cell in mesh.cells}) == len(mesh.cells) <= 210
    assert {joint.b for joint in mesh.joints} & set(BOUNDARIES) == {"ambient"}
    assert mesh.stations


@each_form
def test_all_of_the_coolant_enters_and_leaves(form: Form) -> None:
    stations = designed(form).mesh.stations
    assert sum(station.share for station in stations if not station.before) == pytest.approx(1.0)
    assert designed(form).system().leaves.sum() == pytest.approx(1.0)


@each_form
def test_energy_in_a_run_closes_in_every_form(form: Form) -> None:
    plant = Plant(SEED, form=form)
    pulse = drives.pulse(0.25 * form.machine.top_rpm, 0.75 * form.machine.torque_Nm, 30.0, 120.0)
    truth = plant.run(pulse)
    stored = float(plant.capacity @ (truth.temperatures[-1] - truth.temperatures[0]))
    passed = float((truth.heat - truth.to_coolant - truth.to_ambient).sum()) * float(truth.t_s[1])
    assert stored == pytest.approx(passed, rel=1e-9)
    assert stored > 0.02 * truth.heat.sum() * float(truth.t_s[1])


@each_form
def test_every_watt_of_a_loss_lands_in_a_cell(form: Form) -> None:
    mesh = designed(form).mesh
    assert losses.shares(mesh).sum(axis=1) == pytest.approx(np.ones(len(HEATS)))
    g = form.geometry
    lengths = 2 * g.stack + 2 * (2 * g.near_length + g.crown("a") + g.crown("b"))
    phase = g.slots * g.layers * (g.turns / g.paths) ** 2 * RHO_COPPER_20 / g.bar_area * lengths / 2
    assert losses.direct(mesh, 0.0).sum() == pytest.approx(phase)
    slot = losses.alternating_shares(mesh)[: g.layers].sum()
    assert slot == pytest.approx(phase * 2 * g.stack / lengths)


def test_a_section_resolves_slots_and_teeth_across_the_axis() -> None:
    plant, (steady, _) = designed(SECTION), at_rated_point(SECTION)
    at = {cell.name: t for cell, t in zip(plant.mesh.cells, steady, strict=True)}
    assert at["bar3.1"] > at["wall3.1"] + 3.0
    assert at["flank_mid.1"] > at["tooth_mid.1"] + 0.2
    assert at["yoke_in.1"] > at["back_in.1"] + 0.2


@each_form
def test_the_rated_point_is_a_balance_with_believable_temperatures_and_losses(form: Form) -> None:
    plant, (steady, after) = designed(form), at_rated_point(form)
    assert after.temperatures[-1] == pytest.approx(steady, abs=0.01)
    heat = after.heat[-1]
    assert after.to_coolant[-1] + after.to_ambient[-1] == pytest.approx(heat, rel=1e-4)
    assert after.to_coolant[-1] > 0.3 * heat
    assert after.to_ambient[-1] > 0.02 * heat
    assert 100.0 < points.hot_spot(plant, steady[None])[0] < 170.0
    cells = {node: plant.mesh.of_node(node) for node in NODES}
    mean = {node: np.average(steady[these], weights=plant.capacity[these]) for node, these in cells.items()}
    assert 65.0 < mean["jacket"] < mean["yoke"] < mean["teeth"] < mean["winding_a"]
    assert 65.0 < mean["bearing_a"] < mean["shaft"] < mean["magnet"] < 130.0
    shaft_power = form.rated[1] * form.rated[0] * np.pi / 30
    assert 0.88 < shaft_power / (shaft_power + heat) < 0.98


@each_form
def test_a_twice_finer_mesh_changes_little(form: Form) -> None:
    point = drives.hold(*form.rated, 1.0)
    finer = Plant(0, roughness=0.0, axial=12, form=form)
    for node in NODES:
        means = [p.steady(point, *form.rated)[p.mesh.of_node(node)].mean() for p in (designed(form), finer)]
        assert means[0] == pytest.approx(means[1], abs=3.0), node


@each_form
def test_a_form_makes_its_torque_and_a_believable_power(form: Form) -> None:
    scale = form.machine
    speed = np.linspace(0.03, 1.0, 40) * scale.top_rpm
    point = machine.operate(speed, np.full(40, 2 * scale.torque_Nm), np.full(40, 100.0), scale)
    assert point.torque[0] == pytest.approx(scale.torque_Nm, rel=0.12)
    assert point.current.max() < 1.01 * scale.current_A
    assert np.hypot(point.u_d, point.u_q).max() < 1.1 * scale.voltage_V
    assert -point.i_d[-1] > 0.3 * scale.peak_A


@each_form
def test_phase_resistance_and_density_of_current_are_believable(form: Form) -> None:
    g, scale = form.geometry, form.machine
    resistance = designed(form).system().dc.sum() / 3
    drop = resistance * scale.peak_A / scale.voltage_V
    assert 0.015 < drop < 0.06
    assert 12e6 < scale.current_A / g.paths * g.turns / g.bar_area < 35e6


def test_iron_loss_of_the_weakened_form_falls_with_current_at_high_speed() -> None:
    scale = WEAKENED.machine
    for share, falls in ((0.25, False), (0.9, True)):
        speed = np.full(8, share * scale.top_rpm)
        torque = np.linspace(0.0, 0.97, 8) * machine.largest_torque(float(speed[0]), machine=scale)
        point = machine.operate(speed, torque, np.full(8, 100.0), scale)
        heats = losses.heats(LossLaws(WEAKENED.losses), point, speed, np.ones(8))
        assert (np.diff(point.current) > 0.0).all()
        for groups in (("teeth", "tips"), ("yoke",)):
            watts = heats[:, [HEATS.index(group) for group in groups]].sum(axis=1)
            assert (watts[-1] < 0.9 * watts[0]) == falls, groups


# ---- seeds and effects ---------------------------------------------------------------------------------------------


@each_form
def test_specimens_of_a_form_repeat_and_differ(form: Form) -> None:
    one, again = healthy(form), recorded(form)
    assert np.array_equal(one.truth.temperatures, again.truth.temperatures)
    assert all(np.array_equal(a.values, b.values) for a, b in zip(one.blocks, again.blocks, strict=True))
    other = Plant(SEED + 1, form=form).run(rough_drive(form), 1)
    assert np.abs(other.temperatures[-1] - one.truth.temperatures[-1]).max() > 1.0


REACTIONS = [*(kind for kind in KINDS if kind != "unknown"), *(f"unknown.{what}" for what in UNKNOWN)]


@each_form
@pytest.mark.parametrize("kind", REACTIONS)
def test_every_kind_of_cause_moves_the_readings_of_every_form(form: Form, kind: str) -> None:
    causes = {hidden.cause: hidden.effects()[-1] for hidden in CATALOGUE if hidden.cause.startswith(kind)}
    for effect in list(causes.values())[:: max(len(causes) // 2, 1)]:
        shown, before = recorded(form, effect), healthy(form)
        moved = [
            not np.array_equal(a.values, b.values) or not np.array_equal(a.t_ns, b.t_ns)
            for a, b in zip(shown.blocks, before.blocks, strict=True)
        ]
        assert any(moved), effect.cause
        same = np.array_equal(
            shown.truth.temperatures[:, : before.truth.temperatures.shape[1]], before.truth.temperatures
        )
        assert same == (effect.kind in ("sensor", "clock", "input", "boundary")), effect.cause
