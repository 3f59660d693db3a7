"""From sessions to what is known of each specimen: its checks with the dose before each, its oven cycles, all the
heat it had."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ingest.catalogue.channels import load
from ingest.errors import DamageError
from ingest.facts.events import SessionRecorded
from ingest.facts.facts import Facts
from ingest.facts.store import Store
from replay.engine.specimen.heat_history import (
    CHECKED,
    HEATED,
    HoursByTemperature,
    Trace,
    doses,
    in_order,
    trace_of_heat,
)
from replay.studies.ageing.assessment import HotHours, OvenCycle
from replay.studies.ageing.configured_checks import LoggedCheck, evaluate_checks, logged_check
from replay.studies.ageing.dc_checks import NO_COUNTERS, Evaluated, evaluated
from replay.studies.ageing.discharge import Electrical, discharge_of, electrical_of

if TYPE_CHECKING:
    from analytics.insulation.checks.resistance import CheckResistance

Floats = NDArray[np.float64]
Tell = Callable[[str], None]

ELSEWHERE = "evaluated elsewhere"
UNKNOWN_SHARE = 0.01  # of the hours of oven cycles, from which on those in gaps of the logs are told


@dataclass(frozen=True, slots=True)
class Point:
    """A check with the dose before it [h] and that dose's `worth` (4,), as `worth_of` says it; both None where they are
    not known, and `why` then. `cycles`: how many oven cycles the specimen had before; `discharge_h`: how many hours its
    test voltage was above the inception voltage [h]. Both are None of a row of a table, hours of discharge also where
    they are not known. `counters`: what a table counted besides, by channel."""

    session: SessionRecorded
    start_ns: int | None
    dose_h: float | None
    worth: Floats | None
    found: CheckResistance | Evaluated
    why: str | None
    cycles: int | None = None
    discharge_h: float | None = None
    counters: Mapping[str, float] = field(default_factory=lambda: NO_COUNTERS)

    @property
    def resistance(self) -> float | None:
        """R [K/W], or None."""
        return self.found.resistance_K_per_W

    @property
    def sd(self) -> float | None:
        """Standard deviation of the resistance [K/W], or None."""
        return None if isinstance(self.found, Evaluated) else self.found.sd_K_per_W

    @property
    def source(self) -> str | None:
        """The route that R came by, or None."""
        return ELSEWHERE if isinstance(self.found, Evaluated) else self.found.source

    @property
    def usable(self) -> bool:
        """Whether both dose and R are known."""
        return self.dose_h is not None and self.resistance is not None and self.resistance > 0.0


@dataclass(frozen=True)
class History:
    """What is known of a specimen: `points` in order of dose; `worth` (4,) of all its heat, None where an oven log
    has no temperatures; `notes` for a person."""

    points: list[Point] = field(default_factory=list)
    cycles: list[OvenCycle] = field(default_factory=list)
    hours: list[HotHours] = field(default_factory=list)
    worth: Floats | None = None
    notes: list[str] = field(default_factory=list)


def is_table(facts: Facts, session: SessionRecorded) -> bool:
    """Whether the session holds rows of checks that were evaluated elsewhere, or of hours that vehicles counted."""
    return any(
        channel["quantity"] in ("thermal_resistance", "dose") and channel["role"] != "ignored"
        for file in session.files
        for channel in facts.decodes[file["decode"]].channels
    )


def is_check(facts: Facts, session: SessionRecorded) -> bool:
    """Whether the session tells of a specimen's insulation or its dose."""
    return session.kind == CHECKED or is_table(facts, session)


def of_ageing(facts: Facts) -> list[SessionRecorded]:
    """Every session of a specimen that has a check or counted hours: a hot drive ages its insulation too."""
    known = {session.specimen for session in facts.sessions if is_check(facts, session)} - {None}
    return [session for session in facts.sessions if session.specimen in known]


def histories(
    store: Store, facts: Facts, ageing: Sequence[SessionRecorded], motor: str | None, as_of: str | None, tell: Tell
) -> dict[str, History]:
    """Specimen -> what is known of it. `ageing`: the sessions of `of_ageing`; `motor`: a model that checks in one of
    its configurations are evaluated through."""
    by_specimen: dict[str, list[SessionRecorded]] = defaultdict(list)
    for session in ageing:
        by_specimen[str(session.specimen)].append(session)
    rows: dict[str, list[Evaluated]] = defaultdict(list)
    if any(is_table(facts, session) for some in by_specimen.values() for session in some):
        tell("reading tables")
        for row in evaluated(store, facts, as_of):
            rows[row.session].append(row)
    found = {}
    for name, sessions in by_specimen.items():
        logs = [session for session in sessions if session.session not in rows]
        tell(f"reading {name}")
        history = _of_logs(store, facts, motor, logs) if logs else History()
        given = [(session, row) for session in sessions for row in rows.get(session.session, ())]
        found[name] = with_tables(history, given) if given else history
    return found


def worth_of(heat: HoursByTemperature) -> Floats:
    """What heat is worth (4,): hours above the threshold, then what all hours are worth at it by each of
    `arrhenius.RULES`."""
    from analytics.insulation.dose.arrhenius import RULES, THRESHOLD_DEGC, equivalent_hours

    above = heat.hours[heat.degC > THRESHOLD_DEGC].sum()
    return np.array(
        [above, *(equivalent_hours(heat.degC, heat.hours, THRESHOLD_DEGC, rule, -math.inf) for rule in RULES)]
    )


# ---- logs ----------------------------------------------------------------------------------------------------------


def _of_logs(store: Store, facts: Facts, motor: str | None, sessions: Sequence[SessionRecorded]) -> History:
    ordered, by_time = in_order(sessions)
    heats: dict[str, Trace | None] = {session.session: None for session in ordered if session.kind == HEATED}
    checks: dict[str, LoggedCheck] = {}
    notes: list[str] = []
    electrical: dict[str, Electrical] = {}
    for session in ordered:
        try:
            channels = load(store, facts, session)
        except DamageError as error:
            notes.append(str(error))
            continue
        electrical[session.session] = electrical_of(session, channels)
        if trace := trace_of_heat(channels):
            heats[session.session] = trace
        if session.kind == CHECKED:
            checks[session.session] = logged_check(store, facts, session, channels, motor)
    if checks and not by_time:
        notes.append(
            "its logs have no absolute time: checks and oven sessions are in the order of the numbers in their names"
        )
    dose = doses(ordered, by_time, heats, _worth, worth_of(NOTHING))
    discharge = discharge_of(ordered, by_time, electrical)
    if discharge.why:
        notes.append(discharge.why)
    found, said = evaluate_checks(list(checks.values()))
    notes += said
    answers = dict(zip(checks, found, strict=True))
    cycles = list(_oven_cycles(ordered, heats))
    unknown_h = sum(one.unknown_h for one in cycles)
    if unknown_h > UNKNOWN_SHARE * sum(one.hours_above for one in cycles):
        notes.append(
            f"{unknown_h:.1f} h of its oven cycles are in gaps of the logs and count in no dose: "
            '`whyhot sql "FROM oven_cycles WHERE unknown_h > 0"` says in which.'
        )
    points = [
        Point(
            session=session,
            start_ns=session.start_ns if session.absolute else None,
            dose_h=None if worth is None else float(worth[0]),
            worth=worth,
            found=answers[session.session],
            why="an oven session before it has no temperature of the specimen" if worth is None else None,
            cycles=_before(session, ordered, by_time, cycles),
            discharge_h=discharge.before[session.session],
        )
        for session in ordered
        if session.session in answers
        for worth in [dose[session.session]]
    ]
    hours = [
        HotHours(session.session, session.name, trace.channel, trace.heat)
        for session in ordered
        if (trace := heats.get(session.session)) is not None
    ]
    return History(points, cycles, hours, _all_heat(ordered, heats), notes)


def _before(
    session: SessionRecorded, ordered: Sequence[SessionRecorded], by_time: bool, cycles: Sequence[OvenCycle]
) -> int:
    """How many of the cycles were over before the session."""
    if by_time:
        return sum(bool((one.start_ns or 0) + one.soak_to_s * 1e9 <= session.start_ns) for one in cycles)
    earlier = {one.session for one in ordered[: ordered.index(session)]}
    return sum(one.session in earlier for one in cycles)


def _all_heat(sessions: Sequence[SessionRecorded], heats: Mapping[str, Trace | None]) -> Floats | None:
    """What all sessions are worth together; None without any session, and where an oven log has no temperatures."""
    known = [trace for trace in heats.values() if trace is not None]
    if not sessions or len(known) < len(heats):
        return None
    return np.asarray(np.sum([worth_of(NOTHING), *map(_worth, known)], axis=0), np.float64)


def _worth(trace: Trace) -> Floats:
    """`worth_of` its heat, with the hours above the threshold counted to the moment at which it is crossed."""
    from analytics.insulation.dose.arrhenius import THRESHOLD_DEGC

    found = worth_of(trace.heat)
    found[0] = trace.hours_above(THRESHOLD_DEGC)
    return found


NOTHING = HoursByTemperature(np.empty(0), np.empty(0))


def _oven_cycles(sessions: Iterable[SessionRecorded], heats: Mapping[str, Trace | None]) -> Iterator[OvenCycle]:
    """Every stay above the threshold in the specimen's sessions, counted in their order."""
    from analytics.insulation.dose.oven_cycle import cycles

    stays = (
        (session, trace, (trace.t_ns[0] - session.start_ns) / 1e9, stay)
        for session in sessions
        if (trace := heats.get(session.session)) is not None
        for stay in cycles((trace.t_ns - trace.t_ns[0]) / 1e9, trace.degC)
    )
    for number, (session, trace, begins_s, stay) in enumerate(stays, 1):
        times = {name: getattr(stay, name) for name in ("heating_from_s", "soak_from_s", "soak_to_s", "cooling_to_s")}
        of_session = {name: None if time_s is None else time_s + begins_s for name, time_s in times.items()}
        yield OvenCycle(
            session=session.session,
            session_name=session.name,
            channel=trace.channel,
            number=number,
            start_ns=session.start_ns if session.absolute else None,
            **vars(stay) | of_session,
        )


# ---- tables --------------------------------------------------------------------------------------------------------


def with_tables(history: History, rows: Sequence[tuple[SessionRecorded, Evaluated]]) -> History:
    """The history with the rows of tables: checks that were evaluated elsewhere, and hours that were counted until
    then.

    A row of a check that says no dose has what was counted by its time, between two readouts in proportion.
    """
    given, rows = len(rows), _once(rows)
    if twice := given - len(rows):
        what = "a row stands" if twice == 1 else f"{twice} rows stand"
        said = f"{what} in two tables, with the same time and values: each such check counts once"
        history = replace(history, notes=[*history.notes, said])
    counted = [(row.t_ns or 0, worth_of(row.counted)) for _, row in rows if row.counted is not None]
    readouts = sorted(counted, key=lambda one: one[0])
    points = [_row_point(session, row, readouts) for session, row in rows if _is_check(row)]
    every = sorted([*history.points, *points], key=_place)
    worths = [*(worth for _, worth in readouts), *(point.worth for point in points if point.worth is not None)]
    worth = np.max(worths, axis=0) if worths else None
    if history.worth is not None and history.worth[0] > 0.0:
        worth = history.worth if worth is None else worth + history.worth
    last = max((row for row in rows if row[1].counted), key=lambda row: row[1].t_ns or 0, default=None)
    if last is not None and last[1].counted is not None:  # readouts sum up since the motor was made
        latest = HotHours(last[0].session, last[0].name, "counters", last[1].counted)
        history = replace(history, hours=[*history.hours, latest])
    return replace(history, points=every, worth=worth)


def _once(rows: Sequence[tuple[SessionRecorded, Evaluated]]) -> list[tuple[SessionRecorded, Evaluated]]:
    """The rows without checks that an earlier table holds already, as a list that grows and is given again does: to
    the statistics a copy would be a repeat without error. Two alike in one table are two checks of one day."""
    kept = []
    here: Counter[tuple[object, ...]] = Counter()
    most: Counter[tuple[object, ...]] = Counter()  # times that one table holds the check
    for session, row in rows:
        if row.t_ns is not None and row.resistance_K_per_W is not None:
            check = (row.t_ns, row.resistance_K_per_W, row.dose_h, row.degC, *sorted(row.counters.items()))
            here[session.session, *check] += 1
            if here[session.session, *check] <= most[check]:
                continue
            most[check] += 1
        kept.append((session, row))
    return kept


def _is_check(row: Evaluated) -> bool:
    """Whether the row is of a check, and no readout of counters alone: a check may lack its R."""
    return row.resistance_K_per_W is not None or row.counted is None


def _row_point(session: SessionRecorded, row: Evaluated, readouts: Sequence[tuple[int, Floats]]) -> Point:
    dose, worth = row.dose_h, None
    if dose is not None and row.degC is not None and dose >= 0.0:
        worth = worth_of(HoursByTemperature(np.array([row.degC]), np.array([dose])))
        worth[0] = dose
    elif dose is None and row.counted is not None:
        worth = worth_of(row.counted)
    elif dose is None and readouts and row.t_ns is not None and readouts[0][0] <= row.t_ns <= readouts[-1][0]:
        at, known = zip(*readouts, strict=True)
        worth = np.array([np.interp(row.t_ns, at, course) for course in np.transpose(known)])
    if dose is None and worth is not None:
        dose = float(worth[0])
    known_h = None if dose is None or dose < 0.0 else dose
    why = _why_unusable(row, dose)
    return Point(session, row.t_ns, known_h, worth, _possible(row), why, counters=row.counters)


def _possible(row: Evaluated) -> Evaluated:
    """The row without an R that cannot be one."""
    r = row.resistance_K_per_W
    return row if r is None or r > 0.0 else replace(row, resistance_K_per_W=None)


def _why_unusable(row: Evaluated, dose_h: float | None) -> str | None:
    """What the check lacks, or None."""
    r = row.resistance_K_per_W
    if dose_h is None:
        return "neither the row nor a counter's readout around it says a dose"
    if dose_h < 0.0:
        return f"its row says a dose of {dose_h:g} h, which cannot be below 0"
    if r is None:
        return "its row says no R"
    return f"its row says an R of {r:g} K/W, which must be above 0" if r <= 0.0 else None


def _place(point: Point) -> tuple[float, int]:
    return (math.inf if point.dose_h is None else point.dose_h, point.start_ns or 0)
