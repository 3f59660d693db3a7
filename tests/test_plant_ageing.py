"""The independent truth of ageing is sound: it conserves energy, follows its laws, repeats, and hides what it says."""

from __future__ import annotations

import csv
import json
import tomllib
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from zoneinfo import ZoneInfo

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from plant import bare_stator, bare_stator_motor, counters, dc_check, fleet, insulation_campaign, life, oven
from plant.bare_stator import BORE_AIR, CAPACITY, FILMS, INDEX, JOINTS, LUMPS, Rig, designed
from plant.deterioration import (
    FORMS,
    Changepoint,
    DipThenRise,
    Faster,
    Monotone,
    PaperCourse,
    Unchanged,
    acceleration,
    draw,
)
from plant.insulation_campaign import Campaign
from plant.timeline import PAPER, Plan
from replay.cli import main

Floats = NDArray[np.float64]

SHORT = Rig(heating_s=1800.0, cooling_s=600.0)


def _uneven(size: int, seed: int = 5) -> bare_stator.Stators:
    """Stators that differ in everything."""
    random = np.random.default_rng(seed)
    return bare_stator.Stators(
        random.uniform(0.7, 1.6, size),
        random.uniform(0.6, 0.95, size),
        random.uniform(0.6, 0.95, size),
        np.exp(0.2 * random.standard_normal((size, len(JOINTS)))),
        np.exp(0.1 * random.standard_normal((size, len(LUMPS)))),
        random.uniform(0.95, 1.05, size),
    )


# ---- bare stator ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("film", FILMS)
def test_heat_in_is_heat_lost_and_heat_stored(film: str) -> None:
    stators, rig = _uneven(3), replace(SHORT, film=film)
    t_s = np.arange(round((rig.heating_s + rig.cooling_s) / rig.step_s) + 1) * rig.step_s
    room = 21.0 + np.array([0.0, 2.0, -2.0]) * np.sin(t_s / 1000.0)[:, None]
    run = bare_stator.run(stators, rig, np.repeat(room[0][:, None], len(LUMPS), axis=1), room)
    stored = ((run.temperature[-1] - run.temperature[0]) * CAPACITY * stators.capacity).sum(axis=1)
    np.testing.assert_allclose(run.energy_in_J, run.energy_out_J + stored, rtol=2e-6)


def test_a_check_that_never_ends_arrives_at_the_steady_state_where_all_heat_is_lost() -> None:
    stators, rig = _uneven(2), Rig(heating_s=30 * 3600.0, cooling_s=0.0, step_s=30.0)
    room = np.full(2, 23.0)
    steady, heat, lost = bare_stator.steady(stators, rig, room)
    np.testing.assert_allclose(heat, lost, rtol=1e-12)
    start, rooms = np.full((2, len(LUMPS)), 23.0), np.tile(room, (3601, 1))
    run = bare_stator.run(stators, rig, start, rooms)
    np.testing.assert_allclose(run.temperature[-1], steady, atol=1e-3)


def test_a_run_is_that_of_heat_balances_written_out_lump_by_lump() -> None:
    stators, room = _uneven(1), 20.0
    solved = solve_ivp(
        lambda t, y: _rate(stators, y, room, 160.0 if t < 1800.0 else 0.0),
        (0.0, 1800.0),
        np.full(len(LUMPS), room),
        "Radau",
        rtol=1e-8,
        atol=1e-8,
    )
    run = bare_stator.run(stators, SHORT, np.full((1, len(LUMPS)), room), np.full((481, 1), room))
    np.testing.assert_allclose(run.temperature[360, 0], solved.y[:, -1], atol=5e-3)


def _rate(stators: bare_stator.Stators, degC: Floats, room: float, amps: float) -> Floats:
    """K/s of each lump, without arrays."""
    watts = np.zeros(len(LUMPS))
    for joint, share in zip(JOINTS, stators.conduction[0], strict=True):
        g = joint.W_per_K / stators.insulation[0] if joint.insulates else joint.W_per_K * share
        watts[joint.a] += g * (degC[joint.b] - degC[joint.a])
        watts[joint.b] -= g * (degC[joint.b] - degC[joint.a])
    for place, name in enumerate(LUMPS):
        part, _, where = name.partition("_")
        if where[:1] in ("u", "v") and part in ("slot", "near", "crown"):
            share = {"slot": 0.22, "near": 0.11, "crown": 0.17}[part]
            watts[place] += amps**2 * 6.0e-3 * share * stators.copper[0] * (1 + 0.00393 * (degC[place] - 20.0))
        if name == "support":
            emissivity = 0.9
        else:
            emissivity = (stators.head_emissivity if part in ("near", "crown") else stators.iron_emissivity)[0]
        seen = 5.670374419e-8 * bare_stator.SEES_ROOM[place] * emissivity
        watts[place] -= seen * ((degC[place] + 273.15) ** 4 - (room + 273.15) ** 4)
        excess, above_bore = degC[place] - room, degC[place] - degC[BORE_AIR]
        covered = 0.7 if name == "crown_va" else 1.0
        watts[place] -= 1.3 * 1.98 * bare_stator.ROOM_m2[place] * covered * (abs(excess) + 0.01) ** 0.25 * excess
        to_bore = 1.3 * 0.8 * 1.98 * bare_stator.BORE_m2[place] * (abs(above_bore) + 0.01) ** 0.25 * above_bore
        watts[place] -= to_bore
        watts[BORE_AIR] += to_bore
    bore = degC[BORE_AIR] - room
    watts[BORE_AIR] -= 0.11 * np.sqrt(abs(bore) + 0.01) * bore
    return np.asarray(watts / (CAPACITY * stators.capacity[0]))


def test_half_the_step_quarters_the_error() -> None:
    stators, ends = _uneven(1), []
    for step in (40.0, 20.0, 10.0):
        rig = replace(SHORT, step_s=step)
        rooms = np.full((round(2400.0 / step) + 1, 1), 20.0)
        ends.append(bare_stator.run(stators, rig, np.full((1, len(LUMPS)), 20.0), rooms).temperature[-1, 0, :18])
    coarse, fine = np.abs(ends[0] - ends[1]).max(), np.abs(ends[1] - ends[2]).max()
    assert fine < 0.05
    assert 2.8 < coarse / fine < 5.5


def test_films_have_the_form_that_their_name_says() -> None:
    excess, air = np.array([20.0, 160.0]), np.full(2, 20.0)
    low, high = bare_stator.film_W_per_m2K("quarter", excess, air)
    assert high / low == pytest.approx(8.0**0.25, rel=1e-3)
    low, high = bare_stator.film_W_per_m2K("third", excess, air)
    assert high / low == pytest.approx(2.0, rel=1e-3)
    low, high = bare_stator.film_W_per_m2K("churchill", excess, air)
    assert 1.2 < high / low < 8.0**0.25  # the properties of hot air take some of it back
    assert 3.0 < low < 6.0


def test_darker_surfaces_cool_the_hottest_place_and_worse_insulation_heats_it() -> None:
    stators = replace(
        designed(4),
        head_emissivity=np.array([0.8, 0.9, 0.8, 0.8]),
        iron_emissivity=np.array([0.8, 0.9, 0.8, 0.8]),
        insulation=np.array([1.0, 1.0, 1.5, 1.0]),
    )
    steady, heat, _ = bare_stator.steady(stators, Rig(), np.array([22.0, 22.0, 22.0, 26.0]))
    hottest = steady[:, INDEX["crown_va"]]
    assert -7.0 < hottest[1] - hottest[0] < -4.0
    assert 2.0 < hottest[2] - hottest[0] < 4.0
    resistance = dc_check.resistance_K_per_W(steady, heat) / dc_check.resistance_K_per_W(steady, heat)[0]
    assert 0.985 < resistance[1] < 0.998  # of R the surfaces change little
    assert 1.28 < resistance[2] < 1.4
    assert resistance[3] == pytest.approx(1.0, abs=0.01)


def test_the_hottest_thermocouple_is_3v_of_the_upper_head() -> None:
    steady, _, _ = bare_stator.steady(designed(1), Rig(), np.array([22.0]))
    readings = (steady @ dc_check.weights().T)[0]
    assert dc_check.THERMOCOUPLES[int(readings.argmax())].signal == dc_check.HOTTEST
    assert [sensor.end for sensor in dc_check.THERMOCOUPLES] == ["a"] * 6 + ["b"] * 6


def test_the_motor_file_of_the_rig_holds_the_stator_s_heat_and_is_accepted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = bare_stator_motor.motor_toml()
    motor = tomllib.loads(text)
    stator = [node for node in motor["node"] if node["name"] != "rotor"]
    apart = CAPACITY[[INDEX["support"], BORE_AIR]].sum()
    assert sum(node["capacity"] for node in stator) == pytest.approx(CAPACITY.sum() - apart)
    cold_W = {
        "motor": sum(source["terms"][0]["coefficient"] for source in motor["source"]),
        "rig": sum(source["terms"][0]["coefficient"] for source in motor["configuration"][0]["source"]),
    }
    assert cold_W["rig"] == pytest.approx(2 * 160.0**2 * 6.0e-3, rel=1e-4)
    assert cold_W["rig"] / cold_W["motor"] == pytest.approx(2 / 3, rel=1e-4)
    (tmp_path / "motor.toml").write_text(text, encoding="utf-8")
    assert main(["motor", "check", str(tmp_path / "motor.toml")]) == 0
    assert "stator_in_air: 5 nodes, 1 boundary" in capsys.readouterr().out


# ---- deterioration -------------------------------------------------------------------------------------------------


def test_an_hour_counts_as_arrhenius_says() -> None:
    for activation, hours in ((1.1, 1217.0), (0.9, 2025.0)):
        assert 20_000.0 / acceleration(230.0, activation, 180.0) == pytest.approx(hours, abs=1.0)
    assert acceleration(230.0, 1.0) == 1.0


def test_forms_do_what_their_names_say() -> None:
    dose = np.linspace(0.0, 200.0, 4001)
    assert not Unchanged().ln_factor(dose).any()
    for curvature in (0.5, 1.0, 2.0):
        monotone = Monotone(0.3, 200.0, curvature).ln_factor(dose)
        assert monotone[-1] == pytest.approx(0.3)
        assert (np.diff(monotone) > 0.0).all()
    dip = DipThenRise(0.2, 30.0, 0.2)
    assert dip.change_at_h == pytest.approx(dose[dip.ln_factor(dose).argmin()], abs=0.05)
    assert dip.ln_factor(dip.change_at_h or 0.0) < -0.02
    assert DipThenRise(0.1, 100.0, 0.2).change_at_h is None
    change = Changepoint(80.0, 0.25, 0.05)
    assert not change.ln_factor(dose[dose <= 80.0]).any()
    assert change.ln_factor(180.0) == pytest.approx(0.3)
    faster = Faster(dip, 0.1)
    assert faster.change_at_h == pytest.approx(dose[faster.ln_factor(dose).argmin()], abs=0.05)
    paper = PaperCourse(0.12, 0.08, 12.0)
    np.testing.assert_allclose(paper.ln_factor([0.0, 48.0, 96.0, 180.0, 300.0]), [0.0, -0.06, -0.12, 0.08, 0.08])


@pytest.mark.parametrize("name", FORMS)
def test_drawn_forms_are_worth_telling(name: str) -> None:
    dose = np.linspace(0.0, 200.0, 401)
    for seed in range(20):
        form = draw(name, np.random.default_rng(seed), 200.0, 12.0)
        course = form.ln_factor(dose)
        assert form.name == {"paper": "dip_then_rise"}.get(name, name)
        assert course[0] == 0.0
        assert name == "none" or np.ptp(course) > 0.15
        if name == "dip_then_rise":
            assert course.min() < -0.02
            assert course[-1] > 0.0


# ---- oven ----------------------------------------------------------------------------------------------------------


def test_copper_and_iron_in_the_oven_are_those_of_an_integrator() -> None:
    trace = oven.run(np.random.default_rng(1), [oven.Soak(soak_h=1.0, cooling_h=1.0)])
    air = np.vstack([trace.t_s, trace.oven])

    def rate(t: float, y: Floats) -> Floats:
        here = np.interp(t, *air)
        copper = 3.2 * (here - y[0]) + 25.0 * (y[1] - y[0])
        return np.array([copper / 2600.0, (4.5 * (here - y[1]) + 25.0 * (y[0] - y[1])) / 6700.0])

    solved = solve_ivp(rate, (0.0, trace.t_s[-1]), [22.0, 22.0], t_eval=trace.t_s, max_step=30.0, rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose([trace.copper, trace.iron], solved.y, atol=1e-3)


def test_hours_above_are_counted_between_samples() -> None:
    rising = np.array([0.0, 1.0, 2.0, 3.0]) * 3600.0
    trace = oven.Trace(rising, np.zeros(4), np.array([100.0, 200.0, 160.0, 160.0]), np.zeros(4))
    assert trace.hours_above(180.0) == pytest.approx(0.2 + 0.5)
    assert trace.hours_above(90.0) == pytest.approx(3.0)
    assert trace.hours_above(201.0) == 0.0


def test_a_soak_of_twelve_hours_is_about_twelve_hours_of_dose_and_of_damage() -> None:
    trace = oven.run(np.random.default_rng(1), [oven.Soak()])
    assert 12.0 < trace.hours_above() < 12.5
    assert 11.0 < trace.damage_h(1.0, 230.0) < 12.0
    hotter = oven.run(np.random.default_rng(1), [oven.Soak(offset_K=4.0)])
    assert hotter.damage_h(1.0, 230.0) / trace.damage_h(1.0, 230.0) == pytest.approx(
        float(acceleration(234.0, 1.0)), rel=0.01
    )
    assert hotter.hours_above() - trace.hours_above() < 0.1


def test_an_oven_that_fails_leaves_two_soaks() -> None:
    trace = oven.run(np.random.default_rng(1), [oven.Soak(break_h=6.0)])
    hot = trace.copper > 200.0
    assert np.count_nonzero(np.diff(hot.astype(int)) == 1) == 2
    whole = oven.run(np.random.default_rng(1), [oven.Soak()])
    assert 1.0 < whole.hours_above() - trace.hours_above() < 3.0


# ---- campaign ------------------------------------------------------------------------------------------------------

QUICK = Plan(stators=2, cycles=4, repeats=2, period_s=30.0, rig=Rig(step_s=10.0), early_stops=0.0, dead=0.0)


@pytest.fixture(scope="module")
def campaign() -> Campaign:
    return insulation_campaign.run(9, replace(QUICK, forms=("monotone", "none"), bad_batch=True))


def test_a_campaign_repeats_to_the_byte_and_another_seed_does_not(tmp_path: Path) -> None:
    plan = replace(QUICK, stators=1, cycles=1)
    for name, seed in (("one", 1), ("same", 1), ("other", 2)):
        insulation_campaign.write(tmp_path / name, seed, plan)
    files = sorted(path.relative_to(tmp_path / "one") for path in (tmp_path / "one").rglob("*.*"))
    assert [str(file) for file in files] == [
        *("S01/dc_01.csv", "S01/dc_02.csv", "S01/dc_03.csv", "S01/dc_04.csv"),
        *("S01/ie_01.csv", "S01/ie_02.csv", "S01/ie_03.csv", "S01/ie_04.csv", "S01/oven_01.csv"),
        *("bench_dc.toml", "bench_insulation.toml", "bench_oven.toml"),
    ]
    for file in files:
        assert (tmp_path / "one" / file).read_bytes() == (tmp_path / "same" / file).read_bytes()
        is_log = file.suffix == ".csv"
        assert ((tmp_path / "one" / file).read_bytes() != (tmp_path / "other" / file).read_bytes()) == is_log


def test_checks_are_before_the_first_cycle_and_after_each_and_repeats_come_on_the_same_day(campaign: Campaign) -> None:
    for stator in campaign.stators:
        assert [check.cycle for check in stator.checks] == [0, 0, 0, 1, 2, 3, 4]
        starts = [check.log.start for check in stator.checks]
        assert starts == sorted(starts)
        assert starts[0].date() == starts[1].date() < starts[2].date()
        for number, log in enumerate(stator.oven_logs, 1):
            before = max(check.log.start for check in stator.checks if check.cycle < number)
            after = min(check.log.start for check in stator.checks if check.cycle >= number)
            assert before < log.start < after
            assert (after - log.start).total_seconds() > log.t_s[-1] + 3600.0


def test_doses_add_up_and_the_bad_batch_ages_faster(campaign: Campaign) -> None:
    good, bad = campaign.stators
    assert (good.batch, bad.batch, campaign.bad_batches) == ("B1", "B2", ("B2",))
    for stator in campaign.stators:
        doses = np.concatenate([[0.0, 0.0, 0.0], np.cumsum(stator.hours_above)])
        np.testing.assert_allclose([check.dose_h for check in stator.checks], doses)
        for check in stator.checks:
            assert np.log(check.insulation) == pytest.approx(float(stator.form.ln_factor(check.damage_h)))
    assert (good.form.name, bad.form.name) == ("monotone", "monotone")  # hidden as none, in a bad batch
    worst = bad.checks[-1]
    assert np.log(worst.insulation) == pytest.approx(0.35 * worst.damage_h / 100.0)


def test_the_log_of_a_check_holds_the_true_resistance_but_for_its_own_error_and_the_leads(campaign: Campaign) -> None:
    for stator in campaign.stators:
        ratios = []
        for check in stator.checks:
            log = check.log
            last = (log.t_s > 3 * 3600 - 1200) & (log.t_s < 3 * 3600)
            heads = np.mean([log[sensor.signal][last] for sensor in dc_check.THERMOCOUPLES])
            iron = np.mean([log[f"FE_{name}"][last] for name in dc_check.IRON])
            power = np.mean(log["V_DC"][last] * log["I_DC"][last])
            leads = 160.0**2 * 1.5e-3
            measured = (heads - iron) / (power - leads)
            ratios.append(measured / (check.resistance_K_per_W * np.exp(check.factor)))
            assert 0.06 < leads / power < 0.11
        assert ratios == pytest.approx([np.mean(ratios)] * len(ratios), rel=0.01)
        # The thermocouples' own offsets, and 3 h are not for ever.
        assert np.mean(ratios) == pytest.approx(1.0, abs=0.04)


def test_repeats_scatter_as_the_plan_says() -> None:
    plan = Plan(stators=1, cycles=1, repeats=58, rig=Rig(step_s=60.0, heating_s=600.0, cooling_s=60.0))
    factors = [check.factor for check in insulation_campaign.run(4, replace(plan, period_s=60.0)).stators[0].checks]
    assert len(factors) == 60
    assert np.std(factors) == pytest.approx(0.008, rel=0.3)


def test_what_a_plan_leaves_out_changes_nothing_else() -> None:
    plan = replace(QUICK, stators=1, cycles=1)
    whole = insulation_campaign.run(3, plan).stators[0]
    heads = insulation_campaign.run(3, replace(plan, iron=False)).stators[0]
    for check, same in zip(whole.checks, heads.checks, strict=True):
        assert {column.name for column in check.log.columns} - {column.name for column in same.log.columns} == {
            f"FE_{name}" for name in dc_check.IRON
        }
        np.testing.assert_array_equal(check.log["EW_A_3v"], same.log["EW_A_3v"])
        np.testing.assert_array_equal(check.log["T_room"], same.log["T_room"])
    short = insulation_campaign.run(3, replace(plan, early_stops=1.0, dead=1.0)).stators[0]
    for check, cut in zip(whole.checks, short.checks, strict=True):
        assert cut.stops_s is not None
        assert cut.log.t_s[-1] <= cut.stops_s < 0.6 * plan.rig.heating_s < check.log.t_s[-1]
        assert cut.resistance_K_per_W == check.resistance_K_per_W
    dead = [(check, signal) for check in short.checks for signal in check.dead]
    assert dead
    living = insulation_campaign.run(3, replace(plan, dead=1.0)).stators[0]
    check = next(check for check in living.checks if check.dead)
    silent = np.isnan(check.log[check.dead[0]])
    assert silent[-1]
    assert not silent[0]


def test_the_paper_s_campaign_has_its_cycles() -> None:
    plan = replace(PAPER, rig=Rig(heating_s=600.0, cooling_s=60.0, step_s=60.0), period_s=60.0)
    stator = insulation_campaign.run(1, plan).stators[0]
    assert len(stator.oven_logs) == 21
    assert 295.0 < sum(stator.hours_above) < 310.0
    ln = np.log([check.insulation for check in stator.checks[3:]])
    assert ln.argmin() in (7, 8, 9)
    assert ln[15] > 0.5 * -ln.min() / 2.0 > 0.0
    np.testing.assert_allclose(ln[17:], ln[-1], atol=1e-9)


def test_german_logs_have_local_stamps_and_decimal_commas(tmp_path: Path) -> None:
    plan = replace(
        QUICK, stators=1, cycles=7, repeats=0, rig=Rig(heating_s=60.0, cooling_s=60.0, step_s=60.0), period_s=60.0
    )
    written = insulation_campaign.write(tmp_path, 1, plan)
    for log in written.truth.stators[0].oven_logs:
        text = (tmp_path / "S01" / f"{log.name}.csv").read_text(encoding="cp1252")
        header, units, *rows = csv.reader(text.splitlines(), delimiter=";")
        assert header == ["Zeit", "T_oven", "T_winding", "T_endwinding", "T_yoke"]
        assert units == ["", "°C", "°C", "°C", "°C"]
        first = datetime.strptime(rows[0][0], "%d.%m.%Y %H:%M:%S").replace(tzinfo=ZoneInfo("Europe/Berlin"))
        assert first == log.start
        assert float(rows[0][1].replace(",", ".")) == pytest.approx(log["T_oven"][0])
    stamps = [row.split(";")[0] for row in (tmp_path / "S01" / "oven_07.csv").read_text("cp1252").splitlines()[2:]]
    assert any(stamp.startswith("26.10.2025 02:30") for stamp in stamps)
    assert len(stamps) - len(set(stamps)) == 60  # clocks went back in that night


def test_several_cycles_may_share_a_log() -> None:
    plan = replace(QUICK, stators=1, rig=Rig(heating_s=60.0, cooling_s=60.0, step_s=60.0), period_s=60.0)
    apart = insulation_campaign.run(2, plan).stators[0]
    together = insulation_campaign.run(2, replace(plan, cycles_a_log=3)).stators[0]
    assert [log.name for log in together.oven_logs] == ["oven_01", "oven_02"]
    assert len(together.oven_logs[0].t_s) == sum(len(log.t_s) for log in apart.oven_logs[:3])
    assert together.hours_above == apart.hours_above
    assert (np.diff(together.oven_logs[0].t_s) > 0.0).all()


def test_the_program_takes_the_campaign_in(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rig = Rig(heating_s=900.0, cooling_s=300.0, step_s=10.0)
    plan = Plan(stators=1, cycles=1, rig=rig, early_stops=0.0, dead=1.0, oven_style="italian")
    written = insulation_campaign.write(tmp_path / "campaign", 6, plan)
    store = ["--store", str(tmp_path / "store")]
    for words in written.ingest:
        assert main([words[0], words[1], *words[words.index("--bench") :], *store]) == 0  # the first of each kind
    capsys.readouterr()
    assert main(["sessions", "--json", *store]) == 0
    found = {one["name"]: one for one in json.loads(capsys.readouterr().out)["sessions"]}
    stator = written.truth.stators[0]
    firsts = (stator.checks[0].log, stator.oven_logs[0], stator.insulation_logs[0])
    logs = {log.name: (kind, log) for kind, log in zip(("dc_check", "ageing", "insulation_check"), firsts, strict=True)}
    assert set(found) == set(logs)
    for name, (kind, log) in logs.items():
        assert (found[name]["kind"], found[name]["specimen"]) == (kind, "S01")
        assert datetime.fromisoformat(found[name]["start"]) == log.start.astimezone(UTC)
        assert found[name]["duration_s"] == pytest.approx(log.t_s[-1])


# ---- fleet ---------------------------------------------------------------------------------------------------------


def test_a_fleet_ages_as_it_says() -> None:
    found = fleet.fleet(3, 400, 300, bad_batches=1, bad_motors=4)
    rows = found.checks
    error = np.log(rows.resistance_K_per_W / found.true_resistance_K_per_W)
    number = np.concatenate([np.arange(count) for count in np.bincount(rows.motor)])
    usual = (found.step == 0.0)[rows.motor]
    assert error[usual].std() == pytest.approx(0.03, rel=0.02)
    assert error[usual].mean() == pytest.approx(0.0, abs=0.001)
    assert np.mean(np.abs(error[usual]) > 4 * 0.03) > 3e-3  # of a normal one 6e-5
    assert len(rows.motor) == pytest.approx(0.95 * 400 * 300, rel=0.01)
    batch, motor = np.array(found.batch), np.array(found.serial)
    bad = np.isin(batch, found.bad_batches)
    outlying = np.isin(motor, found.bad_motors)
    assert bad.any()
    assert outlying.sum() == 4
    assert not (bad & outlying).any()
    rest = found.rate[~bad & ~outlying]
    assert found.rate[bad].mean() - rest.mean() == pytest.approx(0.05, abs=0.01)
    assert found.rate[outlying].mean() - rest.mean() == pytest.approx(0.12, abs=0.02)
    assert rest.std() == pytest.approx(0.012, rel=0.1)
    late = number > 0
    assert (np.diff(rows.dose_h)[late[1:]] > 0.0).all()
    stepped = found.step != 0.0
    assert 0.01 < stepped.mean() < 0.06
    for place in np.flatnonzero(stepped)[:3]:
        own = rows.motor == place
        after = error[own][-20:].mean() - error[own][:20].mean()
        assert after == pytest.approx(found.step[place], abs=0.03)


def test_end_of_life_is_where_the_resistance_has_grown_by_the_factor() -> None:
    found = fleet.fleet(3, 50, 3)
    at = found.dose_at(2.0)
    ageing = found.rate > 0.0
    np.testing.assert_allclose(found.rate[ageing] * at[ageing] / 100.0, np.log(2.0))
    assert np.isinf(at[~ageing]).all()


def test_errors_without_a_standard_deviation_are_refused() -> None:
    with pytest.raises(ValueError, match="degrees of freedom"):
        fleet.fleet(1, 3, 3, population=fleet.Population(tails=2.0))


def test_a_table_of_checks_holds_the_fleet_in_no_order(tmp_path: Path) -> None:
    written = fleet.write_checks(tmp_path, 5, 60, late=0.1, dates=True, bad_motors=2)
    truth = written.truth
    tables = [list(csv.DictReader(path.read_text().splitlines())) for path in written.tables]
    assert [path.name for path in written.tables] == ["checks.csv", "checks_late.csv"]
    assert len(tables[1]) == np.sum(truth.checks.arrived > truth.checks.day)
    assert 0.05 < len(tables[1]) / len(truth.checks.motor) < 0.15
    rows = [*tables[0], *tables[1]]
    said = {(row["serial"], row["batch"], float(row["dose_h"]), float(row["R_th"])) for row in rows}
    checks = truth.checks
    true = {
        (truth.serial[m], truth.batch[m], round(float(d), 2), round(float(r), 6))
        for m, d, r in zip(checks.motor, checks.dose_h, checks.resistance_K_per_W, strict=True)
    }
    assert said == true
    serials = [row["serial"] for row in tables[0]]
    assert serials != sorted(serials)
    assert np.bincount(checks.motor).max() <= 21
    by_motor: dict[str, list[tuple[str, float]]] = {}
    for row in rows:
        by_motor.setdefault(row["serial"], []).append((row["date"], float(row["dose_h"])))
    for some in by_motor.values():
        assert [dose for _, dose in sorted(some)] == sorted(dose for _, dose in some)


@pytest.mark.parametrize("dates", [False, True])
def test_the_program_takes_a_table_of_checks_in(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], dates: bool
) -> None:
    written = fleet.write_checks(tmp_path / "fleet", 5, 4, dates=dates)
    store = ["--store", str(tmp_path / "store")]
    for words in written.ingest:
        assert main([*words, *store]) == 0
    capsys.readouterr()
    assert main(["sessions", "--json", *store]) == 0
    found = json.loads(capsys.readouterr().out)["sessions"]
    assert {one["specimen"] for one in found} == set(written.truth.serial)
    assert {one["kind"] for one in found} == {"dc_check"}


def test_counters_of_vehicles_only_grow_and_their_bins_hold_the_damage(tmp_path: Path) -> None:
    read = counters.counters(4, 300)
    middle = (read.edges_degC[:-1] + read.edges_degC[1:]) / 2.0
    from_bins = read.hours @ acceleration(middle, read.activation_eV, 180.0)
    ratio = from_bins / read.true_equivalent_h
    assert 0.7 < np.median(ratio) < 1.1  # the middle of a bin is not where the damage is
    low = read.hours @ acceleration(read.edges_degC[:-1], read.activation_eV, 180.0)
    high = read.hours @ acceleration(read.edges_degC[1:], read.activation_eV, 180.0)
    assert (low < read.true_equivalent_h).all()
    assert (read.true_equivalent_h < high).all()
    same = read.motor[1:] == read.motor[:-1]
    for values in (read.starts, read.day, *read.hours.T):
        assert (np.diff(values)[same] >= 0.0).all()
    path = counters.write_counters(tmp_path / "counters.csv", read, ["B1"] * 300)
    rows = list(csv.DictReader(path.read_text().splitlines()))
    assert len(rows) == len(read.motor)
    assert float(rows[5]["h_80_100"]) == pytest.approx(read.hours[5, 6], abs=0.01)


# ---- life ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("distribution", life.DISTRIBUTIONS)
def test_lives_have_the_quantiles_of_their_law(distribution: str) -> None:
    found = life.lives(2, n=4000, distribution=distribution)
    for degC in (190.0, 260.0):
        own = found.life_h[found.temperature_degC == degC]
        for share in (0.1, 0.5, 0.632):
            assert np.mean(own < found.law.quantile_h(degC, share)) == pytest.approx(share, abs=0.03)
    assert found.law.quantile_h(180.0) == pytest.approx(20_000.0)


def test_the_temperature_index_is_where_the_median_is_the_life_and_the_halving_interval_halves_it() -> None:
    law = life.Law(median_h=20_000.0, activation_eV=1.0)
    assert law.temperature_index_degC() == pytest.approx(180.0, abs=1e-6)
    step = law.halving_interval_K()
    assert law.quantile_h(180.0 + step) == pytest.approx(10_000.0, rel=1e-6)
    warmer = 1.0 / (1.0 / 453.15 - np.log(2.0) * 8.617333262e-5) - 453.15
    assert step == pytest.approx(warmer, abs=1e-6)


@pytest.mark.parametrize("distribution", life.DISTRIBUTIONS)
@pytest.mark.parametrize("censoring", life.CENSORING)
def test_what_is_seen_of_a_life_holds_it(censoring: str, distribution: str) -> None:
    found = life.lives(7, n=300, distribution=distribution, censoring=censoring)
    assert (found.lower_h <= found.life_h).all()
    assert (found.life_h <= found.upper_h).all()
    going = np.isinf(found.upper_h)
    assert going.mean() == pytest.approx(0.3 if censoring in ("right", "both") else 0.0, abs=0.08)
    exact = found.lower_h == found.upper_h
    assert exact.mean() == {"none": 1.0, "right": 1.0 - going.mean()}.get(censoring, 0.0)
    np.testing.assert_array_equal(found.life_h, life.lives(7, n=300, distribution=distribution).life_h)


def test_a_censoring_that_is_none_is_refused() -> None:
    with pytest.raises(ValueError, match="none, right, interval, both"):
        life.lives(1, censoring="left")
