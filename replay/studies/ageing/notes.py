"""What a person should know of an assessment beside its answer: a line each, with what to do."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ingest.facts.facts import Facts
from replay.studies.ageing.history import History, Point, is_check

if TYPE_CHECKING:
    from analytics.insulation.courses.forms import Form

Floats = NDArray[np.float64]

NOTES = 20  # of single specimens
MISFIT = 3.0  # root mean square of what checks are off their course by, in sds, from which on no form fits
UNLIKE = 1.25  # from which on hours of specimens are not worth the same: 5 K at 215 degC


def shortened(lines: Iterable[str]) -> list[str]:
    """The first lines, and how many more there are."""
    every = list(lines)
    more = len(every) - NOTES
    return [*every[:NOTES], f"{more} more such notes"] if more > 1 else every


def unnamed(facts: Facts) -> list[str]:
    """How many checks name no specimen."""
    count = sum(session.specimen is None and is_check(facts, session) for session in facts.sessions)
    if not count:
        return []
    what = "1 check without a specimen is" if count == 1 else f"{count} checks without a specimen are"
    return [
        f"{what} left out: name the specimen (--specimen S, or specimen_column of the bench file) and ingest again."
    ]


def differ_in_case(names: Sequence[str]) -> list[str]:
    """The specimens whose names are one but for capitals and blanks, as somebody types them in a hurry."""
    alike: dict[str, list[str]] = {}
    for name in names:
        alike.setdefault("".join(name.split()).casefold(), []).append(name)
    return list(
        shortened(
            f"{' and '.join(some)} are counted as {len(some)} specimens: if they are one, give its logs one name "
            f"(whyhot correct, --specimen {some[0]}), or correct the rows of its table and ingest that."
            for some in alike.values()
            if len(some) > 1
        )
    )


def unequal_heat(worth: Mapping[str, Floats | None]) -> list[str]:
    """That an hour of the dose is not worth the same for all specimens, which slopes in hours know nothing of."""
    from analytics.insulation.dose.arrhenius import RULES, THRESHOLD_DEGC

    known = {name: float(all_h[1] / all_h[0]) for name, all_h in worth.items() if all_h is not None and all_h[0] >= 1.0}
    if not known:
        return []
    least, most = min(known, key=known.__getitem__), max(known, key=known.__getitem__)
    if known[most] < UNLIKE * known[least]:
        return []
    said = (
        f"specimens were not equally hot: by {RULES[0].name} an hour above {THRESHOLD_DEGC:g} °C was worth "
        f"{known[least]:.1f} h at {THRESHOLD_DEGC:g} °C for {least} and {known[most]:.1f} h for {most}. R per 100 h, "
        "the law and what stands out count these hours alike: compare specimens of one temperature."
    )
    return [said]


def misfit(name: str, history: History, sd: Sequence[float | None], form: Form | None) -> list[str]:
    """That the most probable form does not fit the checks of a specimen, and between which R changes most."""
    if form is None or form.course is None:
        return []
    dose, ln_r, own = np.array(
        [
            (point.dose_h, math.log(point.resistance), one)
            for point, one in zip(history.points, sd, strict=True)
            if one is not None and point.dose_h is not None and point.resistance is not None
        ]
    ).T
    off = (ln_r - np.interp(dose, form.course.dose_h, form.course.ln_middle)) / own
    times = float(np.sqrt(np.sort(off**2)[:-1].mean()))  # one odd check may be anywhere
    if times < MISFIT:
        return []
    k = int(np.abs(np.diff(ln_r)).argmax())
    step = f"{100.0 * math.expm1(ln_r[k + 1] - ln_r[k]):+.0f} %".replace("-", "−")
    said = (
        f"{name}: its checks are off the most probable course by {times:.0f} times their sd: R changes most, "
        f"by {step}, between {dose[k]:.0f} h and {dose[k + 1]:.0f} h. If it was repaired there or a sensor moved, "
        "name its later sessions as another specimen."
    )
    return [said]


def unusable(points: Sequence[Point]) -> list[str]:
    """How many checks say no R or no dose."""
    lacking = sum(not point.usable for point in points)
    if not lacking:
        return []
    where = '`whyhot sql "FROM conductivity_by_cycle WHERE why IS NOT NULL"`'
    return [f"{lacking} of {len(points)} checks say no R or no dose, and no course has them: {where} says why."]


def not_heat_alone(others: Sequence[str]) -> list[str]:
    """That `others` did part of what the law puts down to heat."""
    said = (
        f"the law counts hours of heat, and {' and '.join(others)} did part of it: it holds for specimens that have as "
        "much of that for their hours."
    )
    return [said] if others else []
