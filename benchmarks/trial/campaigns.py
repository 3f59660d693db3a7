"""The campaign of a case: a plant driven through its sessions and logged, and the logs read as `whyhot diagnose` reads
them."""

from __future__ import annotations

import os
import pickle
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from benchmarks.shared import stored
from benchmarks.trial.cases import READ_WRONG, Case
from ingest.facts import facts
from plant import Effect, Plant, drives, points, write_campaign
from plant.crude import LUMPS
from plant.drives import Drive
from plant.forms import FORMS
from plant.geometry import NODES
from plant.plant import Truth
from plant.sensors import LAG_s, Recording, lagged, record, sensors
from plant.thermocouples import Sensor
from replay.studies.characterise.calibrate import common_model
from replay.studies.diagnosis import question
from replay.studies.diagnosis.question import Campaign

Floats = NDArray[np.float64]
Course = Mapping[str, Floats]  # signal or node -> (N,), once a second
T = TypeVar("T")

# Of a session: what it is, its speed over the top speed (of a cycle: mass and road load over the vehicle's), minutes.
Session = tuple[str, float, float]
LEARNT: tuple[Session, ...] = (
    ("s1", 0.375, 30.0),
    ("s2", 0.5, 20.0),
    ("wltp", 1.0, 30.0),
    ("s1", 0.2, 20.0),
    ("s1", 0.7, 20.0),
    ("s2", 0.3, 20.0),
    ("wltp", 1.3, 30.0),
    ("s1", 0.1, 20.0),
)
KEPT: tuple[Session, ...] = (("s1", 0.5625, 20.0), ("wltp", 1.0, 30.0), ("s2", 0.4, 20.0), ("s1", 0.28, 20.0))


@dataclass(frozen=True)
class Behind:
    """What stands behind the logs of a campaign. `effects` are hidden; `learnt` sessions are learnt from, the others
    kept; `moved`: of each effect and session learnt from, by how much it alone moves the reading of each signal,
    without noise [K] (no session for one that only reads wrong); `nodes`: of each kept session the true mean
    temperature of each node and lump of the file [degC]."""

    effects: tuple[Effect, ...]
    learnt: int
    moved: tuple[tuple[Course, ...], ...]
    nodes: tuple[Course, ...]


def kept_count(sessions: int) -> int:
    """How many of so many sessions are kept."""
    return max(2, sessions // 3)


def planned(plant: Plant, sessions: int, longest_s: float) -> list[Drive]:
    """The drives of a campaign, those that are learnt from first; points are found on the plant itself."""
    kept = kept_count(sessions)
    chosen = [*LEARNT[: sessions - kept], *KEPT[:kept]]
    return [drive_of(plant, one, number).first(longest_s) for number, one in enumerate(chosen)]


def drive_of(plant: Plant, session: Session, number: int) -> Drive:
    """The drive of a session, the so manyth of its campaign."""
    kind, share, minutes = session
    if kind == "wltp":
        return drives.wltp(1, plant.form.vehicle, trailer=share)
    point = points.s1 if kind == "s1" else points.s2
    return point(plant, share * plant.form.machine.top_rpm, minutes, number)


def driven(case: Case, effects: Sequence[Effect], folder: Path) -> Behind:
    """Run and log a specimen with these effects; beside its logs, in `healthy`, those of the same specimen without
    them in the sessions that are learnt from, on the same drives."""
    form = FORMS[case.form]
    plant = Plant(case.seed, *effects, form=form)
    plan = planned(plant, case.sessions, case.longest_s)
    learnt = case.sessions - kept_count(case.sessions)
    truths = [one.truth for one in logged(folder, case, plant, plan)]
    healthy = logged(folder / "healthy", case, Plant(case.seed, form=form), plan[:learnt]) if effects else []
    without = [one.truth for one in healthy]
    moved = tuple(moved_by(effect, case, plan, without) for effect in effects)
    places = {**{node: (node,) for node in NODES}, **LUMPS.get(case.rule, {})}
    nodes = tuple({name: _mean(truth, plant, own) for name, own in places.items()} for truth in truths[learnt:])
    return Behind(tuple(effects), learnt, moved, nodes)


def logged(folder: Path, case: Case, plant: Plant, plan: Sequence[Drive]) -> list[Recording]:
    """Run and log a plant."""
    recordings = [record(plant, plant.run(drive, number), case.layout) for number, drive in enumerate(plan)]
    write_campaign(folder, plant, recordings, layout=case.layout, rule=case.rule)
    return recordings


def moved_by(effect: Effect, case: Case, plan: Sequence[Drive], without: Sequence[Truth]) -> tuple[Course, ...]:
    """What an effect alone does to the readings of the sessions that ran `without` it; nothing where it only reads
    wrong."""
    if effect.kind in READ_WRONG:
        return ()
    plant = Plant(case.seed, effect, form=FORMS[case.form])
    with_it = (plant.run(drive, number) for number, drive in enumerate(plan[: len(without)]))
    return tuple(difference(a, b, plant, case.layout) for a, b in zip(without, with_it, strict=True))


def middles(seconds: float, step_s: float = 1.0) -> Floats:
    """The middle of each step [s], (N,)."""
    return (np.arange(round(seconds / step_s), dtype=np.float64) + 0.5) * step_s


def difference(without: Truth, with_it: Truth, plant: Plant, layout: str) -> Course:
    """Signal -> (N,) K: readings with the effect less those without, once a second."""
    t = middles(without.drive.seconds)
    return {
        sensor.signal: _reading(with_it, plant, sensor, t) - _reading(without, plant, sensor, t)
        for sensor in sensors(layout, plant.form)
    }


def _reading(truth: Truth, plant: Plant, sensor: Sensor, t_s: Floats) -> Floats:
    """What a sensor placed as designed reads, without noise."""
    marks = {"m": plant.mesh.axial // 2, "e": plant.mesh.axial - 1}
    cells = np.array([plant.mesh.index[stem.format(**marks)] for stem, _ in sensor.cells], np.intp)
    place = truth.at(cells, np.array([weight for _, weight in sensor.cells]))
    reading: Floats = np.interp(t_s, truth.t_s, lagged(place, LAG_s, float(truth.t_s[1])))
    return reading


def _mean(truth: Truth, plant: Plant, nodes: Sequence[str]) -> Floats:
    """The mean temperature of the nodes' cells by their heat capacity, once a second [degC]."""
    cells = np.concatenate([plant.mesh.of_node(node) for node in nodes])
    mean = truth.at(cells, plant.mesh.capacity[cells])
    course: Floats = np.interp(middles(truth.drive.seconds), truth.t_s, mean)
    return course


def read(folder: Path) -> Campaign:
    """The logs of a folder, ingested and read: every session as one to learn from."""
    logs = sorted(folder.glob("*.blf"), key=lambda log: int(log.stem.split("_")[0]))
    with tempfile.TemporaryDirectory() as name, stored(folder, logs, Path(name)) as store:
        known = facts.at(store.ledger)
        sessions = [known.session(log.stem) for log in logs]
        model = common_model(known, sessions)
        return question.campaign_of(question.Question(store, known, sessions, [], model, "testing"))


def kept_as(path: Path, make: Callable[[], T]) -> T:
    """What was made before, else made now and kept."""
    if not path.exists():
        found = make()
        path.parent.mkdir(parents=True, exist_ok=True)
        part = path.with_suffix(f".{os.getpid()}")
        part.write_bytes(pickle.dumps(found))
        part.replace(path)
    kept: T = pickle.loads(path.read_bytes())
    return kept
