"""What an assessment of ageing says, as data: one dataclass, `document` its one JSON (`whyhot.ageing/1`)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

from replay.engine.results.as_json import from_json, to_json
from replay.engine.specimen.heat_history import HoursByTemperature

SCHEMA = "whyhot.ageing/1"


@dataclass(frozen=True, kw_only=True)
class DcCheck:
    """One DC check. `dose_h`: hours above the threshold before it; `equivalent_h`: the same dose as hours at the
    threshold, [least, most] over the rules of `Assessment.rules`, None where the temperatures are not known; `sd`
    [K/W] of this check alone; `sd_percent` [% of R] together with how checks repeat, by which courses are weighed;
    `from_`: what R was taken from; `why` there is no R, or no dose; `conductivity_percent`: of the specimen's first
    check. `cycles`, `discharge_h`: how many thermal cycles were before it, and hours with a test voltage above the
    inception voltage; None where not known."""

    session: str
    session_name: str
    start_ns: int | None
    number: int
    dose_h: float | None
    equivalent_h: list[float] | None
    resistance_K_per_W: float | None
    sd: float | None
    from_: str | None
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
    over all logs. The rest is that of `analytics.insulation.dose.oven_cycle.Cycle`, times [s] since the session's
    start; rates as IEC 60068-2-14 states them."""

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
    fleet's; `fitted`: R by the form over the dose, with the ends of 95 % (`dose_h`, `resistance_K_per_W`, `low`,
    `high`), None where no form was assessed."""

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
    fitted: dict[str, list[float]] | None = None


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


Compared = TypeVar("Compared", Specimen, Batch)


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
class Density:
    """How many `checks` (m, n) lie in each cell of a picture of all courses, between edges `dose_h` (n + 1) [h] and
    edges `percent` (m + 1) of R in % of the specimen's first check."""

    dose_h: list[float]
    percent: list[float]
    checks: list[list[int]]


@dataclass(frozen=True, kw_only=True)
class FleetCounts:
    """All specimens, of which an answer holds a part where they are many: how many with how many checks, how many
    stand out; `changed`: how many of `weighed` change in which form, all or as many of them drawn by chance; `density`
    in place of their courses, where these are too many to tell apart."""

    specimens: int
    checks: int
    weighed: int
    changed: dict[str, int]
    outlying: int
    density: Density | None


@dataclass(frozen=True, kw_only=True)
class Assessment:
    """The whole answer. `specimens`: all, or of a large fleet those that stand out most, the first one most; `whole`
    counts them all. `law`: None where no course is beyond repeatability. `rules`: names of the rules by which an
    hour at one temperature is worth some at another; a number is by one rule, never by a mixture."""

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
    whole: FleetCounts
    batches: list[Batch]
    stress: list[StressEffect]
    false_discovery_rate: float
    notes: list[str]


def document(found: Assessment, provenance: Mapping[str, Any]) -> dict[str, Any]:
    """The answer as the JSON `whyhot.ageing/1`."""
    fleet = {
        "outlying_specimens": [
            {"specimen": one.specimen, "batch": one.batch, "score": one.score} for one in _outlying(found.specimens)
        ],
        "outlying_batches": [{"batch": one.batch, "score": one.score} for one in _outlying(found.batches)],
        "false_discovery_rate": found.false_discovery_rate,
    }
    said = to_json(found)
    del said["false_discovery_rate"], said["notes"]
    return {"schema": SCHEMA, **said, "fleet": fleet, "notes": found.notes, "provenance": dict(provenance)}


def _outlying(some: Sequence[Compared]) -> list[Compared]:
    """Those that stand out, the worst first."""
    return sorted((one for one in some if one.outlying), key=lambda one: -(one.score or 0.0))


def read(data: Mapping[str, Any]) -> Assessment:
    """The answer that `document` wrote."""
    known = data.get("whole") or to_json(_of_all(from_json(list[Specimen], data["specimens"])))
    whole, rate = {"weighed": known["specimens"], **known}, data["fleet"]["false_discovery_rate"]
    found: Assessment = from_json(Assessment, {**data, "whole": whole, "false_discovery_rate": rate})
    return found


def _of_all(specimens: Sequence[Specimen]) -> FleetCounts:
    """The counts of an answer from before there were any: it holds all specimens."""
    return FleetCounts(
        specimens=len(specimens),
        checks=sum(len(one.checks) for one in specimens),
        weighed=len(specimens),
        changed=dict(Counter(one.form for one in specimens if one.significant).most_common()),
        outlying=sum(one.outlying for one in specimens),
        density=None,
    )
