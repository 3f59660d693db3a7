"""A campaign as its engineer keeps it: for each stator a folder with DC checks, oven logs and insulation checks, and
a bench file for each kind of log.

Every stator hides a form of deterioration; their surfaces darken, the room is not the same from day to day, and no
two ovens are equally hot. What is true of each check is handed back.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from plant import bare_stator, bare_stator_motor, dc_check, discharge, insulation_check, oven, timeline
from plant.bare_stator import JOINTS, LUMPS, Stators
from plant.deterioration import Form, OVEN_degC
from plant.tables import STYLES, Column, write_table
from plant.timeline import BATCHES, CHECK_HOUR, Course, Plan

Floats = NDArray[np.float64]

HEADS, IRON = (0.80, 0.10), (0.80, 0.08)  # emissivity when new, and what it gains
DARKENS_h = 80.0  # of damage


@dataclass(frozen=True)
class Log:
    """One table as it was recorded: `t_s` (N,) from `start` on."""

    name: str
    start: datetime
    t_s: Floats
    columns: tuple[Column, ...]

    def __getitem__(self, signal: str) -> Floats:
        """The values (N,) of a signal. Raises KeyError where there is none."""
        return {column.name: column.values for column in self.columns}[signal]


@dataclass(frozen=True)
class Check:
    """One DC check. `dose_h`: hours of the copper above 180 degC before it, `discharge_h` above the inception
    voltage; `damage_h`: equivalent hours of the insulation at 230 degC by the hidden activation energy; `insulation`:
    resistance of the slots over what it was when new; `resistance_K_per_W`: mean of the winding heads minus mean of
    the iron over the heat in the copper, steady, as perfect sensors have it (so with what dark surfaces do to it,
    without the leads); `factor`: the check's own error in ln R."""

    log: Log
    cycle: int
    dose_h: float
    discharge_h: float
    damage_h: float
    insulation: float
    resistance_K_per_W: float
    factor: float
    head_emissivity: float
    room_degC: float
    stops_s: float | None
    dead: tuple[str, ...]


@dataclass(frozen=True)
class Stator:
    """One stator, its logs in the order of time. `form`: of the slots' resistance over damage; `hours_above`: of the
    copper above 180 degC in each cycle."""

    name: str
    batch: str
    form: Form
    checks: tuple[Check, ...]
    hours_above: tuple[float, ...]
    oven_logs: tuple[Log, ...]
    insulation_logs: tuple[Log, ...]


@dataclass(frozen=True)
class Campaign:
    """What truly happened and what was recorded."""

    plan: Plan
    activation_eV: float
    stators: tuple[Stator, ...]

    @property
    def bad_batches(self) -> tuple[str, ...]:
        """Batches that age faster than the others."""
        return BATCHES[1:] if self.plan.bad_batch else ()


@dataclass(frozen=True)
class Written:
    """A campaign and the folder that holds it."""

    truth: Campaign
    folder: Path

    @property
    def ingest(self) -> list[list[str]]:
        """The words of each command that takes the files in: one for each stator and kind of log."""
        commands = []
        for stator in self.truth.stators:
            checks = tuple(check.log for check in stator.checks)
            for kind, logs in (("dc", checks), ("oven", stator.oven_logs), ("insulation", stator.insulation_logs)):
                files = [str(self.folder / stator.name / f"{log.name}.csv") for log in logs]
                words = ["ingest", *files, "--bench", str(self.folder / f"bench_{kind}.toml")]
                if files:
                    commands.append([*words, "--specimen", stator.name, "--batch", stator.batch])
        return commands


def write(folder: Path, seed: int, plan: Plan | None = None) -> Written:
    """Run the campaign and write `S01/dc_01.csv`, `S01/oven_01.csv`, `S01/ie_01.csv` ..., `bench_dc.toml`,
    `bench_oven.toml`, `bench_insulation.toml`. The same seed and plan write the same bytes."""
    plan = plan or Plan()
    truth = run(seed, plan)
    checks, others = STYLES[plan.check_style], STYLES[plan.oven_style]
    for stator in truth.stators:
        (folder / stator.name).mkdir(parents=True, exist_ok=True)
        for check in stator.checks:
            _write(folder / stator.name, check.log, plan.check_style)
        for log in (*stator.oven_logs, *stator.insulation_logs):
            _write(folder / stator.name, log, plan.oven_style)
    files = {
        "bench_dc.toml": dc_check.bench_toml(checks, plan.iron, plan.configuration),
        "bench_oven.toml": oven.bench_toml(others, plan.oven_sensors) + discharge.bench_toml() * bool(plan.test_V),
    }
    if plan.electrical:
        files["bench_insulation.toml"] = insulation_check.bench_toml(others)
    if plan.configuration:
        files["motor.toml"] = bare_stator_motor.motor_toml(plan.rig)
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8")
    return Written(truth, folder)


def _write(folder: Path, log: Log, style: str) -> None:
    write_table(folder / f"{log.name}.csv", STYLES[style], log.start, log.t_s, log.columns)


def run(seed: int, plan: Plan | None = None) -> Campaign:
    """The campaign in memory."""
    plan = plan or Plan()
    drawn = float(np.random.default_rng([seed, 61]).uniform(0.9, 1.1))
    activation = plan.activation_eV if plan.activation_eV is not None else drawn
    return Campaign(plan, activation, tuple(_stator(seed, plan, place, activation) for place in range(plan.stators)))


def _stator(seed: int, plan: Plan, place: int, activation_eV: float) -> Stator:
    course = timeline.course(seed, plan, place, activation_eV)
    damage = course.before_checks([trace.damage_h(activation_eV, OVEN_degC) for trace in course.traces])
    discharged = _discharged(plan, place, course, activation_eV)
    insulation = np.exp(course.form.ln_factor(damage) + plan.discharge_rate * discharged / 100.0)
    random = np.random.default_rng([seed, 63, place])
    return Stator(
        course.name,
        course.batch,
        course.form,
        _checks(random, plan, course, damage, insulation, discharged),
        tuple(course.hours_above),
        _oven_logs(random, plan, place, course),
        _insulation_logs(random, course, np.log(insulation)) if plan.electrical else (),
    )


def _discharged(plan: Plan, place: int, course: Course, activation_eV: float) -> Floats:
    """Hours of discharge before each check."""
    if not plan.test_V:
        return np.zeros(len(course.checks))
    damage = np.cumsum([0.0, *(trace.damage_h(activation_eV, OVEN_degC) for trace in course.traces)])
    alone = course.form.ln_factor(damage).tolist()
    return course.before_checks(discharge.hours(alone, plan.tests(place), plan.discharge_rate))


def _checks(
    random: np.random.Generator,
    plan: Plan,
    course: Course,
    damage_h: Floats,
    insulation: Floats,
    discharge_h: Floats,
) -> tuple[Check, ...]:
    """All checks of one stator, run together."""
    rig, size = plan.rig, len(damage_h)
    stators = _at_each_check(random, plan, damage_h, insulation)
    times = np.arange(round((rig.heating_s + rig.cooling_s) / rig.step_s) + 1, dtype=np.float64) * rig.step_s
    means = random.normal(21.0, 1.5, size)
    hours = [CHECK_HOUR + (start - course.checks[0]).total_seconds() / 3600.0 for start in course.checks]
    rooms = np.column_stack(
        [dc_check.room(random, times, hour, mean, plan.swing_K) for hour, mean in zip(hours, means, strict=True)]
    )
    warm = np.where(course.done > 0, random.uniform(0.0, 1.5, size), 0.0)
    start = np.repeat((rooms[0] + warm)[:, None], len(LUMPS), axis=1)
    heated = bare_stator.run(stators, rig, start, rooms)
    steady, heat, _ = bare_stator.steady(stators, rig, rooms.mean(axis=0))
    resistance, dose = dc_check.resistance_K_per_W(steady, heat), course.before_checks(course.hours_above)
    offsets = dc_check.OFFSET_K * random.standard_normal(len(dc_check.THERMOCOUPLES) + len(dc_check.IRON))
    found = []
    for k in range(size):
        reading = _reading(random, plan)
        t_s, columns = dc_check.columns(random, rig, heated, k, rooms[:, k], offsets, reading)
        found.append(
            Check(
                log=Log(f"dc_{k + 1:02d}", course.checks[k], t_s, tuple(columns)),
                cycle=int(course.done[k]),
                dose_h=float(dose[k]),
                discharge_h=float(discharge_h[k]),
                damage_h=float(damage_h[k]),
                insulation=float(insulation[k]),
                resistance_K_per_W=float(resistance[k]),
                factor=reading.factor,
                head_emissivity=float(stators.head_emissivity[k]),
                room_degC=float(rooms[:, k].mean()),
                stops_s=reading.stops_s,
                dead=reading.dead,
            )
        )
    return tuple(found)


def _at_each_check(random: np.random.Generator, plan: Plan, damage_h: Floats, insulation: Floats) -> Stators:
    """The same stator time and again: only insulation and surfaces change."""
    size = len(damage_h)
    conduction = np.exp(0.10 * random.standard_normal(len(JOINTS)))
    capacity = np.exp(0.04 * random.standard_normal(len(LUMPS)))
    slots, copper = np.exp([0.10, 0.01] * random.standard_normal(2)).tolist()
    dark = plan.darkening * -np.expm1(-damage_h / DARKENS_h)
    return Stators(
        slots * insulation,
        HEADS[0] + HEADS[1] * dark,
        IRON[0] + IRON[1] * dark,
        np.tile(conduction, (size, 1)),
        np.tile(capacity, (size, 1)),
        np.full(size, copper),
    )


def _reading(random: np.random.Generator, plan: Plan) -> dc_check.Reading:
    """The draws do not depend on the plan's shares: with and without, a seed is the same campaign."""
    heating = plan.rig.heating_s
    factor = plan.repeatability * float(random.standard_normal())
    stops, stops_s = random.random(), float(random.uniform(0.25, 0.6)) * heating
    fails, fails_s = random.random(), float(random.uniform(0.0, heating))
    which = dc_check.THERMOCOUPLES[int(random.integers(len(dc_check.THERMOCOUPLES)))].signal
    dead = (which,) if fails < plan.dead and which != dc_check.HOTTEST else ()
    return dc_check.Reading(
        factor, dead, fails_s, stops_s if stops < plan.early_stops else None, plan.period_s, plan.iron
    )


def _oven_logs(random: np.random.Generator, plan: Plan, place: int, course: Course) -> tuple[Log, ...]:
    """Logs of `cycles_a_log` cycles each; between them the logger rests."""
    logs: list[Log] = []
    tests = plan.tests(place)
    for first in range(0, plan.cycles, plan.cycles_a_log):
        places = range(first, min(first + plan.cycles_a_log, plan.cycles))
        begin = course.ovens[first]
        whole = oven.joined([course.traces[k] for k in places], [course.ovens[k] - begin for k in places])
        columns = oven.columns(random, whole, plan.oven_sensors)
        if plan.test_V:
            volts = np.concatenate([discharge.volts(course.traces[k], *tests[k]) for k in places])
            columns.append(discharge.column(random, volts))
        logs.append(Log(f"oven_{len(logs) + 1:02d}", begin, whole.t_s, tuple(columns)))
    return tuple(logs)


def _insulation_logs(random: np.random.Generator, course: Course, ln_insulation: Floats) -> tuple[Log, ...]:
    """A log on the day of each DC check, once the stator is cold again."""
    return tuple(
        Log(f"ie_{k + 1:02d}", start + insulation_check.AFTER, np.zeros(1), tuple(insulation_check.columns(random, ln)))
        for k, (start, ln) in enumerate(zip(course.checks, ln_insulation.tolist(), strict=True))
    )
