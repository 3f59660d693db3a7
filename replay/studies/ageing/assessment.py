"""What an assessment of ageing says, as data: one dataclass, `document` its one JSON (`whyhot.ageing/1`), `tables`
its rows for SQL."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import pyarrow as pa

from replay.engine.specimen.heat_history import HoursByTemperature

SCHEMA = "whyhot.ageing/1"


@dataclass(frozen=True, kw_only=True)
class DcCheck:
    """One DC check. `dose_h`: hours above the threshold before it; `equivalent_h`: the same dose as hours at the
    threshold, [least, most] over the rules of `Assessment.rules`, None where the temperatures are not known; `sd`
    [K/W] of this check alone, repeatability not in it; `sd_percent` [% of R] with it, as courses are weighed by;
    `source`: what R was taken from (JSON: `from`); `why`: why there is no R, or no dose; `conductivity_percent`: of
    the specimen's first R. `cycles`, `discharge_h` before it: thermal cycles, and hours with a test voltage above the
    inception voltage; None where not known."""

    session: str
    session_name: str
    start_ns: int | None
    number: int
    dose_h: float | None
    equivalent_h: list[float] | None
    resistance_K_per_W: float | None
    sd: float | None
    source: str | None
    state: str | None
    why: str | None
    conductivity_percent: float | None
    hottest_channel: str | None
    hottest_degC: float | None
    sd_percent: float | None = None
    cycles: int | None = None
    discharge_h: float | None = None
    left: dict[str, float] | None = None  # twin.insulation.ageing_state.State, for replays of later sessions


@dataclass(frozen=True, kw_only=True)
class OvenCycle:
    """One stay of the specimen's hottest place above the threshold, cut from the temperature itself; `number` counts
    over all logs.

    Times [s] since the session's start: heating begins, soak, cooling ends; None where the log does not hold it.
    `soak_degC` mean over the soak; `hours_above` the threshold, of which `unknown_h` more lie in gaps of the log. As
    a thermal shock: `swing_K` from its lowest to its highest, and the fastest heating and cooling [K/min], a mean
    over 5 min (IEC 60068-2-14 states rates so).
    """

    session: str
    session_name: str
    channel: str
    number: int
    start_ns: int | None
    heating_from_s: float | None
    soak_from_s: float
    soak_to_s: float
    cooling_to_s: float | None
    highest_degC: float
    soak_degC: float
    hours_above: float
    unknown_h: float
    swing_K: float
    heating_K_per_min: float | None
    cooling_K_per_min: float | None


@dataclass(frozen=True)
class HotHours:
    """Hours of a session by the temperature of the specimen's hottest place, `channel` (or the counters of a
    vehicle)."""

    session: str
    session_name: str
    channel: str
    heat: HoursByTemperature


@dataclass(frozen=True, kw_only=True)
class Specimen:
    """The course of one specimen. `dose_h`, `equivalent_h`: all that is known of its heat, as in its checks;
    `level_from_dose_h`: from where on a rise has become level; `slope_percent_per_100h` of its last branch, R growing
    is positive; `fleet_slope...`: the slope that specimen and fleet together say, with its sd; `remaining_h`: dose
    until the criterion, [least, most] of 95 %, None where there is no end; `score`: how far the slope is from its
    fleet's."""

    specimen: str
    batch: str | None
    cycles: list[OvenCycle]
    checks: list[DcCheck]
    dose_h: float | None
    equivalent_h: list[float] | None
    form: str
    form_probability: float
    change_at_dose_h: float | None
    level_from_dose_h: float | None
    slope_percent_per_100h: float | None
    ci95: list[float] | None
    repeatability_percent: float
    significant: bool
    life_used: list[float] | None
    fleet_slope_percent_per_100h: float | None
    fleet_slope_sd: float | None
    remaining_h: list[float | None] | None
    score: float | None
    outlying: bool
    why: str | None


@dataclass(frozen=True, kw_only=True)
class StressEffect:
    """What one kind of stress does to R beside the others, all specimens together: `percent` in R for each `unit`
    with its sd; `not_told_from`: the stresses that could be it instead, and `percent` is then what it would be if
    they did nothing. None where nothing varies."""

    name: str
    unit: str
    percent: float | None
    sd_percent: float | None
    not_told_from: list[str]


@dataclass(frozen=True, kw_only=True)
class Batch:
    """A batch among the others: mean slope of its specimens, and how far that is from the other batches'."""

    batch: str
    specimens: int
    slope_percent_per_100h: float | None
    score: float | None
    outlying: bool


@dataclass(frozen=True, kw_only=True)
class AgeingLaw:
    """How the conductance of insulation falls: by `percent_per_100h` above the threshold with its `sd`, from `from_h`
    of dose on. `source`: the fleet, or the one specimen that shows a course. `model`: the motor file that says so,
    where a motor was given."""

    percent_per_100h: float
    sd: float
    from_h: float
    source: str
    model: str | None


@dataclass(frozen=True, kw_only=True)
class OneLife:
    """The dose [h] at which a specimen first met the criterion lies between `lower_h` and `upper_h`, the latter None
    where it has not yet; at `degC` on average."""

    specimen: str
    degC: float
    lower_h: float
    upper_h: float | None


@dataclass(frozen=True, kw_only=True)
class LivesLaw:
    """Arrhenius law of the lives; each number a `value` with `ci95`, a bound None where the data give none."""

    distribution: str
    activation_energy_eV: dict[str, Any]
    median_h_at_180degC: dict[str, Any]
    temperature_index_degC: dict[str, Any] | None
    halving_interval_K: dict[str, Any] | None
    why_no_index: str | None


@dataclass(frozen=True, kw_only=True)
class AssessedLives:
    """Lives by a criterion and their law; where `law` is None, `why` says what is missing."""

    criterion: str
    lives: list[OneLife]
    law: LivesLaw | None
    why: str | None


@dataclass(frozen=True, kw_only=True)
class Assessment:
    """The whole answer. `law`: None where no course is beyond repeatability. `rules`: name -> what an hour is worth
    by it; a number is by one rule, never by a mixture."""

    assessment: str
    motor: str | None
    threshold_degC: float
    criterion: str
    activation_energy_eV: Mapping[str, Any]
    rules: list[str]
    repeatability_from: str
    law: AgeingLaw | None
    life: AssessedLives
    specimens: list[Specimen]
    batches: list[Batch]
    stress: list[StressEffect]
    false_discovery_rate: float
    notes: list[str]


def document(found: Assessment, provenance: Mapping[str, Any]) -> dict[str, Any]:
    """The answer as the JSON `whyhot.ageing/1`."""
    outlying = [one for one in found.specimens if one.outlying]
    return {
        "schema": SCHEMA,
        "assessment": found.assessment,
        "motor": found.motor,
        "threshold_degC": found.threshold_degC,
        "criterion": found.criterion,
        "activation_energy_eV": dict(found.activation_energy_eV),
        "rules": found.rules,
        "repeatability_from": found.repeatability_from,
        "law": asdict(found.law) if found.law else None,
        "life": asdict(found.life),
        "specimens": [_specimen(one) for one in found.specimens],
        "batches": [asdict(one) for one in found.batches],
        "stress": [asdict(one) for one in found.stress],
        "fleet": {
            "outlying_specimens": [
                {"specimen": one.specimen, "batch": one.batch, "score": one.score}
                for one in sorted(outlying, key=lambda one: -(one.score or 0.0))
            ],
            "outlying_batches": [
                {"batch": one.batch, "score": one.score}
                for one in sorted(found.batches, key=lambda one: -(one.score or 0.0))
                if one.outlying
            ],
            "false_discovery_rate": found.false_discovery_rate,
        },
        "notes": found.notes,
        "provenance": dict(provenance),
    }


def read(data: Mapping[str, Any]) -> Assessment:
    """The answer that `document` wrote."""
    given = {key: data[key] for key in Assessment.__dataclass_fields__ if key in data}
    fleet = data["fleet"]
    return Assessment(
        **given
        | {
            "specimens": [_read_specimen(one) for one in data["specimens"]],
            "batches": [Batch(**one) for one in data["batches"]],
            "law": AgeingLaw(**data["law"]) if data["law"] else None,
            "life": _read_life(data["life"]),
            "stress": [StressEffect(**one) for one in data["stress"]],
            "false_discovery_rate": fleet["false_discovery_rate"],
        }
    )


def _read_life(data: Mapping[str, Any]) -> AssessedLives:
    law = LivesLaw(**data["law"]) if data["law"] else None
    return AssessedLives(**{**data, "lives": [OneLife(**one) for one in data["lives"]], "law": law})


def _specimen(one: Specimen) -> dict[str, Any]:
    checks = [{"from" if key == "source" else key: value for key, value in vars(check).items()} for check in one.checks]
    return {**vars(one), "checks": checks, "cycles": [vars(cycle) for cycle in one.cycles]}


def _read_specimen(data: Mapping[str, Any]) -> Specimen:
    checks = [
        DcCheck(**{"source" if key == "from" else key: value for key, value in one.items()}) for one in data["checks"]
    ]
    cycles = [OvenCycle(**one) for one in data["cycles"]]
    return Specimen(**{**data, "checks": checks, "cycles": cycles})


def tables(found: Assessment, hours: Mapping[str, Sequence[HotHours]]) -> dict[str, pa.Table]:
    """The rows behind the SQL views. `hours`, of each specimen, are not in the answer: they are many."""
    return {
        "hours": _hours_table(found, hours),
        "cycles": pa.Table.from_pylist([row for one in found.specimens for row in _cycle_rows(one)], CYCLES),
        "checks": pa.Table.from_pylist([row for one in found.specimens for row in _check_rows(one)], CHECKS),
        "specimens": pa.Table.from_pylist([_specimen_row(one) for one in found.specimens], SPECIMENS),
        "batches": pa.Table.from_pylist([asdict(one) for one in found.batches], BATCHES),
    }


def _check_rows(one: Specimen) -> Iterable[dict[str, Any]]:
    for check in one.checks:
        low, high = check.equivalent_h or (None, None)
        yield vars(check) | {
            "specimen": one.specimen,
            "batch": one.batch,
            "equivalent_low_h": low,
            "equivalent_high_h": high,
            "sd_K_per_W": check.sd,
        }


def _hours_table(found: Assessment, hours: Mapping[str, Sequence[HotHours]]) -> pa.Table:
    """One row for each session and temperature at which it spent any time."""
    batch = {one.specimen: one.batch for one in found.specimens}
    parts = [HOURS.empty_table()]
    for specimen, sessions in hours.items():
        for one in sessions:
            there = one.heat.hours > 0.0
            said = (specimen, batch.get(specimen), one.session, one.session_name, one.channel)
            texts = [pa.array([text] * int(there.sum()), pa.string()) for text in said]
            parts.append(pa.Table.from_arrays([*texts, one.heat.degC[there], one.heat.hours[there]], schema=HOURS))
    return pa.concat_tables(parts)


def _cycle_rows(one: Specimen) -> Iterable[dict[str, Any]]:
    return (vars(cycle) | {"specimen": one.specimen, "batch": one.batch} for cycle in one.cycles)


def _specimen_row(one: Specimen) -> dict[str, Any]:
    low, high = one.equivalent_h or (None, None)
    ranges = {"life_used": one.life_used, "slope": one.ci95, "remaining": one.remaining_h}
    ends = {name: tuple(ends or (None, None)) for name, ends in ranges.items()}
    return vars(one) | {
        "checks": len(one.checks),
        "equivalent_low_h": low,
        "equivalent_high_h": high,
        "life_used_low": ends["life_used"][0],
        "life_used_high": ends["life_used"][1],
        "slope_low": ends["slope"][0],
        "slope_high": ends["slope"][1],
        "remaining_low_h": ends["remaining"][0],
        "remaining_high_h": ends["remaining"][1],
    }


def _schema(text: str = "", whole: str = "", number: str = "", truth: str = "") -> pa.Schema:
    kinds = ((text, pa.string()), (whole, pa.int64()), (number, pa.float64()), (truth, pa.bool_()))
    return pa.schema([(name, kind) for names, kind in kinds for name in names.split()])


HOURS = _schema(text="specimen batch session session_name channel", number="degC hours")
CYCLES = _schema(
    text="session session_name specimen batch channel",
    whole="number start_ns",
    number="heating_from_s soak_from_s soak_to_s cooling_to_s highest_degC soak_degC hours_above unknown_h swing_K "
    "heating_K_per_min cooling_K_per_min",
)
CHECKS = _schema(
    text="session session_name specimen batch source state why hottest_channel",
    whole="start_ns number cycles",
    number="dose_h discharge_h equivalent_low_h equivalent_high_h resistance_K_per_W sd_K_per_W sd_percent "
    "conductivity_percent hottest_degC",
)
SPECIMENS = _schema(
    text="specimen batch form why",
    whole="checks",
    number="dose_h equivalent_low_h equivalent_high_h life_used_low life_used_high form_probability change_at_dose_h "
    "slope_percent_per_100h slope_low slope_high repeatability_percent fleet_slope_percent_per_100h fleet_slope_sd "
    "remaining_low_h remaining_high_h score",
    truth="significant outlying",
)
BATCHES = _schema(text="batch", whole="specimens", number="slope_percent_per_100h score", truth="outlying")
