"""What heat has done to the insulation of every specimen in a store: doses, resistances, courses, and who is not as
the others."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import fields, replace
from hashlib import sha256
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ingest.facts.events import AgeingAssessed, SessionRecorded
from ingest.facts.facts import Facts
from ingest.facts.sessions import natural
from ingest.facts.store import Store
from ingest.units.each import Workers
from replay.engine.files.models import published
from replay.engine.files.motor_file import read_motor
from replay.engine.files.motor_text import with_law
from replay.engine.runs.identity import run_id
from replay.engine.runs.sources import code_of
from replay.engine.specimen.aged import law_of, states_left
from replay.errors import ReplayDataError
from replay.studies.ageing.assessment import (
    AgeingLaw,
    Assessment,
    Batch,
    DcCheck,
    FleetCounts,
    Specimen,
    document,
    read,
)
from replay.studies.ageing.configured_checks import models_of
from replay.studies.ageing.history import History, Point, histories, of_ageing
from replay.studies.ageing.lives import lives_of
from replay.studies.ageing.notes import (
    differ_in_case,
    misfit,
    not_heat_alone,
    shortened,
    unequal_heat,
    unnamed,
    unusable,
)
from replay.studies.ageing.stress import beside_heat, stress_of
from replay.studies.ageing.tables import Tables
from replay.studies.ageing.whole import MOST, SAMPLE, density, drawn, rank
from twin.insulation.ageing_state import Check as Seen
from twin.motor.ageing_law import Ageing

if TYPE_CHECKING:
    from analytics.insulation.campaign import Assessed
    from analytics.insulation.courses.forms import FittedCourse
    from analytics.insulation.fleet.outlying import FleetAssessment, SpecimenHealth

Floats = NDArray[np.float64]
Tell = Callable[[str], None]

CRITERION = "conductivity -50 %"
NOT_WEIGHED = f"its course was not weighed: of a fleet {MOST} that stand out most are, and {SAMPLE:,} drawn by chance"
AT_ONCE = 1000  # specimens whose states are in memory together
BATCH = [field.name for field in fields(Batch)]


def assess(
    store: Store,
    facts: Facts,
    motor: str | None,
    as_of: str | None,
    tell: Tell = lambda _: None,
    workers: Workers | None = None,
) -> Assessment:
    """Assess every specimen that has a DC check or a row in a table of evaluated checks.

    The same question again reads the sealed answer; with `as_of` nothing is written. `motor`: a model that the law is
    written into, as a new one; `workers`: where courses are weighed, None for this process. Raises ReplayDataError
    where the store holds no check of a named specimen.
    """
    sessions = of_ageing(facts)
    key = _key(facts, sessions, motor)
    identity = run_id(key)
    if identity in facts.assessments:
        again = facts.assessments[identity]
        if as_of is None and again is not list(facts.assessments.values())[-1]:
            store.ledger.append(f"ageing-{identity}", again)  # the last one is what SQL shows
        return read(json.loads(store.archive.read(again.answer)))
    known = histories(store, facts, sessions, motor, as_of, tell)
    batches = {str(session.specimen): session.batch for session in sessions if session.batch}
    written = Tables(store.work()) if as_of is None else None
    found = _assessed(store, facts, motor, known, batches, identity, written, tell, workers)
    if as_of is None:
        if motor and found.law:
            found = replace(found, law=replace(found.law, model=_published(store, facts, motor, found.law)))
        assert written is not None
        checked = sorted({point.session.session for history in known.values() for point in history.points})
        _seal_answer(store, found, key, written.sealed(store.archive, found.batches), checked)
    return found


def is_of_now(facts: Facts, event: AgeingAssessed) -> bool:
    """Whether an assessment is of the sessions that there are now, as they are now."""
    now = _key(facts, of_ageing(facts), event.key.get("motor"))
    return all(event.key.get(what) == now[what] for what in ("sessions", "models"))


def _key(facts: Facts, sessions: Sequence[SessionRecorded], motor: str | None) -> dict[str, Any]:
    """Everything that the answer may depend on, but for the environment."""
    return {
        "sessions": sha256(json.dumps([_session_key(facts, one) for one in sessions]).encode()).hexdigest(),
        "motor": motor,
        "models": models_of(facts, sessions),
        "code": code_of(__name__),
    }


def _session_key(facts: Facts, one: SessionRecorded) -> list[Any]:
    bench, decodes = facts.current(one.bench) if one.bench else None, [file["decode"] for file in one.files]
    return [one.session, one.batch, one.kind, one.configuration, bench, decodes]


def _assessed(
    store: Store,
    facts: Facts,
    motor: str | None,
    known: Mapping[str, History],
    batches: Mapping[str, str],
    identity: str,
    written: Tables | None,
    tell: Tell,
    workers: Workers | None,
) -> Assessment:
    """The answer; the rows of all specimens, of which it holds `MOST` at most, go into `written`."""
    from analytics.insulation import campaign
    from analytics.insulation.dose import arrhenius

    if not known:
        raise ReplayDataError(
            'no DC check of a named specimen is in this store: ingest logs of checks with kind = "dc_check" and a '
            "specimen, or a table of evaluated checks with the quantities thermal_resistance and dose."
        )
    names = sorted(known, key=natural)
    tell("weighing the courses")
    rows = [(name, point) for name in names for point in known[name].points if point.usable]
    by_chance = drawn(names)
    found = campaign.assess(
        [name for name, _ in rows],
        [batches.get(name) for name, _ in rows],
        [point.dose_h or 0.0 for _, point in rows],
        [point.resistance or 0.0 for _, point in rows],
        [point.sd or 0.0 for _, point in rows],
        workers,
        tell,
        lambda fleet: by_chance.union(_held(names, batches, fleet)),
    )
    repeats, of_each = found.repeatability, iter(found.sd.tolist())
    sd = {name: [next(of_each) if point.usable else None for point in known[name].points] for name in names}
    law = law_of(store, facts, motor, arrhenius.THRESHOLD_DEGC)
    compared = {one.specimen: one for one in found.fleet.specimens}
    held = _held(names, batches, found.fleet)
    specimens: dict[str, Specimen] = {}
    surest: Specimen | None = None
    for name, left in _left(names, known, sd, law):
        one = _specimen(name, batches.get(name), known[name], sd[name], left, found, compared.get(name))
        surest = max((surest, one), key=_surely_changed)
        if written:
            written.add(one, known[name].hours, weighed=name in found.forms or name not in compared)
        if name in held:
            specimens[name] = one
    fleet_law, stress = _law(found, surest), stress_of(rows, found.sd)
    changed = Counter(form.name for name, form in found.forms.items() if form.significant and name in by_chance)
    return Assessment(
        assessment=identity,
        motor=facts.models[motor].motor if motor else None,
        threshold_degC=arrhenius.THRESHOLD_DEGC,
        criterion=CRITERION,
        activation_energy_eV={
            "value": arrhenius.ASSUMED.eV,
            "ci95": [rule.eV for rule in arrhenius.ASSUMED_BAND],
            "from": "assumed",
        },
        rules=[rule.name for rule in arrhenius.RULES],
        repeatability_from="3 %, assumed"
        if repeats.source == "assumed"
        else f"{100 * repeats.sd:.1f} %, from {repeats.source}",
        law=fleet_law,
        life=lives_of({name: known[name] for name in names}, sd, CRITERION),
        specimens=[specimens[name] for name in held],
        whole=FleetCounts(
            specimens=len(names),
            checks=sum(len(history.points) for history in known.values()),
            weighed=len(by_chance),
            changed=dict(changed.most_common()),
            outlying=sum(one.outlying for one in found.fleet.specimens),
            density=density(
                [name for name, _ in rows],
                np.array([point.dose_h for _, point in rows], np.float64),
                np.array([point.resistance for _, point in rows], np.float64),
            ),
        ),
        batches=[Batch(**{key: getattr(one, key) for key in BATCH}) for one in found.fleet.batches],
        stress=stress,
        false_discovery_rate=found.fleet.false_discovery_rate,
        notes=[
            *unnamed(facts),
            *differ_in_case(names),
            *unusable([point for history in known.values() for point in history.points]),
            *shortened(f"{name}: {line}" for name in names for line in known[name].notes),
            *(not_heat_alone(beside_heat(stress)) if fleet_law else ()),
            *unequal_heat({name: known[name].worth for name in names}),
            *shortened(line for name in names for line in misfit(name, known[name], sd[name], found.forms.get(name))),
        ],
    )


def _held(names: Sequence[str], batches: Mapping[str, str], fleet: FleetAssessment) -> list[str]:
    """The specimens that the answer holds, in its order: all in the order of names, or of many the first by `rank`."""
    if len(names) <= MOST:
        return list(names)
    place = rank({one.batch for one in fleet.batches if one.outlying})
    compared = {one.specimen: one for one in fleet.specimens}

    def of(name: str) -> tuple[bool, bool, float]:
        one = compared.get(name)
        return place(bool(one and one.outlying), batches.get(name), one.score if one else None)

    return sorted(names, key=of)[:MOST]


def _surely_changed(one: Specimen | None) -> float:
    """How sure a specimen's course is, to go on with: a rise that has become level is none."""
    goes_on = one and one.significant and one.ci95 and one.level_from_dose_h is None
    return one.form_probability if one and goes_on else -1.0


def _law(found: Assessed, one: Specimen | None) -> AgeingLaw | None:
    """The fleet's slope, with what specimens differ by, where there are three of them; else that of `one`, whose
    course is surest."""
    from analytics.insulation.dose.arrhenius import THRESHOLD_DEGC

    fleet = found.fleet
    if one is None or _surely_changed(one) < 0.0:
        return None
    low, high = one.ci95 or (0.0, 0.0)
    source, slope, sd, from_h = one.specimen, one.slope_percent_per_100h, (high - low) / 3.92, one.change_at_dose_h
    if fleet.slope_percent_per_100h is not None and fleet.specimen_spread is not None:
        source, slope, sd, from_h = "fleet", fleet.slope_percent_per_100h, fleet.specimen_spread, None
    law = Ageing.of_resistance(THRESHOLD_DEGC, slope or 0.0, sd, from_h or 0.0)
    return AgeingLaw(percent_per_100h=law.percent_per_100h, sd=law.sd, from_h=law.from_h, source=source, model=None)


def _published(store: Store, facts: Facts, motor: str, law: AgeingLaw) -> str:
    """The motor file with the law in its insulation, as a model with its parent. Raises MotorFileError where it has
    no insulation."""
    from analytics.insulation.dose.arrhenius import THRESHOLD_DEGC

    parent = facts.models[motor]
    text = store.archive.read(motor)
    network = read_motor(text, parent.file)
    aged = with_law(text.decode("utf-8"), network, law.percent_per_100h, law.sd, THRESHOLD_DEGC, law.from_h)
    model = store.archive.seal(aged.encode("utf-8"))
    store.ledger.append_all(published(facts, motor, model))
    return model


def _left(
    names: Sequence[str], known: Mapping[str, History], sd: Mapping[str, Sequence[float | None]], law: Ageing
) -> Iterator[tuple[str, list[dict[str, float] | None]]]:
    """Each specimen with the state that each of its points leaves, `AT_ONCE` of them at a time."""
    for first in range(0, len(names), AT_ONCE):
        some = names[first : first + AT_ONCE]
        checks = [list(map(_as_filtered, known[name].points, sd[name])) for name in some]
        yield from zip(some, states_left(checks, law), strict=True)


def _specimen(
    name: str,
    batch: str | None,
    history: History,
    sd: Sequence[float | None],
    left: Sequence[dict[str, float] | None],
    found: Assessed,
    compared: SpecimenHealth | None,
) -> Specimen:
    from analytics.insulation.courses import forms
    from analytics.insulation.dose.arrhenius import LIFE_H

    form = found.forms.get(name) or (
        forms.unknown(compared.why or NOT_WEIGHED) if compared else forms.assess([], [], [])
    )
    life = found.remaining.get(name)
    worth = history.worth
    first = next((point.resistance for point in history.points if point.usable), None)
    last = next((point.dose_h for point in reversed(history.points) if point.dose_h is not None), None)
    return Specimen(
        specimen=name,
        batch=batch,
        cycles=history.cycles,
        checks=[_check(point, i, first, sd[i], left[i]) for i, point in enumerate(history.points)],
        dose_h=last if worth is None else float(worth[0]),
        equivalent_h=None if worth is None else _range(worth[1:]),
        form=form.name,
        form_probability=form.probability,
        change_at_dose_h=form.change_at_dose_h,
        level_from_dose_h=form.level_from_dose_h,
        slope_percent_per_100h=form.slope_percent_per_100h,
        ci95=list(form.ci95) if form.ci95 else None,
        repeatability_percent=100 * found.repeatability.sd,
        significant=form.significant,
        life_used=None if worth is None else _range(worth[1:] / LIFE_H),
        fleet_slope_percent_per_100h=life.slope_percent_per_100h if life else None,
        fleet_slope_sd=life.slope_sd if life else None,
        remaining_h=list(life.remaining_ci95_h) if life else None,
        score=compared.score if compared else None,
        outlying=bool(compared and compared.outlying),
        why=form.why or (compared.why if compared else "") or None,
        fitted=_fitted(form.course) if form.course else None,
    )


def _fitted(course: FittedCourse) -> dict[str, list[float]]:
    """Four figures tell a course from its band."""
    ln = {"resistance_K_per_W": course.ln_middle, "low": course.ln_low, "high": course.ln_high}
    said = {"dose_h": course.dose_h, **{name: [math.exp(one) for one in of] for name, of in ln.items()}}
    return {name: [float(f"{value:.4g}") for value in values] for name, values in said.items()}


def _as_filtered(point: Point, sd: float | None) -> Seen | None:
    """The point as the filter over checks takes it."""
    if sd is None or point.dose_h is None or point.resistance is None:
        return None
    return Seen(point.dose_h, math.log(point.resistance), sd)


def _check(point: Point, number: int, first: float | None, sd: float | None, left: dict[str, float] | None) -> DcCheck:
    found, r = point.found, point.resistance
    return DcCheck(
        session=point.session.session,
        session_name=point.session.name,
        start_ns=point.start_ns,
        number=number,
        dose_h=point.dose_h,
        equivalent_h=None if point.worth is None else _range(point.worth[1:]),
        resistance_K_per_W=r,
        sd=point.sd,
        sd_percent=None if sd is None else 100 * sd,
        from_=point.source,
        state=getattr(found, "steady", None),
        why=point.why or getattr(found, "why", None),
        conductivity_percent=100 * first / r if first and r else None,
        hottest_channel=getattr(found, "hottest", None),
        hottest_degC=getattr(found, "hottest_degC", None),
        cycles=point.cycles,
        discharge_h=point.discharge_h,
        left=left,
    )


def _range(values: Floats) -> list[float]:
    return [float(values.min()), float(values.max())]


def _seal_answer(
    store: Store, found: Assessment, key: dict[str, Any], artefacts: dict[str, str], sessions: Sequence[str]
) -> None:
    """Seal the answer, and say so in the ledger: its tables are sealed (`artefacts`), `sessions` hold its checks, of a
    fleet's the first `MOST`: all are in the table of checks."""
    answer = json.dumps(document(found, {})).encode()  # keys in order, so that it is told again as it was told
    store.ledger.append(
        f"ageing-{found.assessment}",
        AgeingAssessed(
            assessment=found.assessment,
            key=key,
            answer=store.archive.seal(answer),
            artefacts=artefacts,
            sessions=list(sessions[:MOST]),
            count=len(sessions),
            digest=sha256(answer).hexdigest(),
        ),
    )
