"""Everything that checks of many specimens say: how well they repeat, each one's form, and who is not as the others."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from threadpoolctl import threadpool_limits

from analytics.errors import WorkerLostError
from analytics.insulation.arrays import Floats
from analytics.insulation.checks import repeatability
from analytics.insulation.checks.repeatability import Repeatability
from analytics.insulation.courses import forms
from analytics.insulation.courses.forms import Form
from analytics.insulation.fleet import outlying, remaining
from analytics.insulation.fleet.outlying import FleetAssessment
from analytics.insulation.fleet.remaining import RemainingLife
from ingest.units.each import Lost, Workers, each

FALSE_DISCOVERY_RATE = 0.05
AT_ONCE = 200  # specimens, of which a worker weighs the courses


@dataclass(frozen=True)
class Assessed:
    """What checks say of many specimens. `sd` (n,) of ln R of each check, as all that follows weighs it
    (`Repeatability.of_checks`); `forms` and `remaining` by specimen, where it has a check; `forms` of those whose
    course was weighed. Fewer than three specimens leave nothing to say of what remains."""

    repeatability: Repeatability
    sd: Floats
    forms: Mapping[str, Form]
    fleet: FleetAssessment
    remaining: Mapping[str, RemainingLife]


def assess(
    specimen: Sequence[str],
    batch: Sequence[str | None],
    dose_h: ArrayLike,
    resistance_K_per_W: ArrayLike,
    sd_K_per_W: ArrayLike,
    workers: Workers | None = None,
    tell: Callable[[str], None] = lambda _: None,
    whose: Callable[[FleetAssessment], Collection[str]] | None = None,
) -> Assessed:
    """Everything that the checks of many specimens say. Arguments have one entry for each check, in any order:
    specimen and batch (n,), dose (n,) [h], R (n,) [K/W] above zero, and what one evaluation leaves uncertain of it
    (n,) [K/W]; how checks repeat comes on top. `workers`: where courses are weighed (None: in this process), the most
    of the work; the answer does not depend on it. `whose`: the specimens whose courses are weighed, by how the fleet's
    compare; None: all. Raises WorkerLostError."""
    resistance, dose = np.asarray(resistance_K_per_W, np.float64), np.asarray(dose_h, np.float64)
    ln_r = np.log(resistance)
    repeats = repeatability.estimate(specimen, dose, ln_r)
    sd = repeats.of_checks(np.asarray(sd_K_per_W, np.float64) / resistance)
    with _one_thread():
        left = {one.specimen: one for one in remaining.remaining(specimen, batch, dose, ln_r, sd)}
        fleet = outlying.assess(specimen, batch, dose, ln_r, sd, FALSE_DISCOVERY_RATE)
    chosen = set(specimen if whose is None else whose(fleet))
    rows: dict[str, list[int]] = {}
    for i, name in enumerate(specimen):
        if name in chosen:
            rows.setdefault(name, []).append(i)
    series = [_Series(name, dose[at], ln_r[at], sd[at], repeats.degrees_of_freedom) for name, at in rows.items()]
    found = dict(_forms(series, workers, tell))
    return Assessed(repeats, sd, {name: found[name] for name in rows}, fleet, left)


@dataclass(frozen=True)
class _Series:
    """The checks of one specimen: dose [h], ln R and its standard deviation (n,), known with `degrees_of_freedom`."""

    specimen: str
    dose_h: Floats
    ln_resistance: Floats
    sd: Floats
    degrees_of_freedom: float


def _forms(
    series: Sequence[_Series], workers: Workers | None, tell: Callable[[str], None]
) -> Iterator[tuple[str, Form]]:
    jobs = [series[first : first + AT_ONCE] for first in range(0, len(series), AT_ONCE)]
    done = 0
    for job, forms_of in each(_weighed, jobs, workers):
        if isinstance(forms_of, Lost):
            raise WorkerLostError(f"the courses of {job[0].specimen} to {job[-1].specimen}: {forms_of.why}")
        yield from zip((one.specimen for one in job), forms_of, strict=True)
        done += len(job)
        tell(f"weighed the courses of {done:,} of {len(series):,} specimens")


def _weighed(some: Sequence[_Series]) -> list[Form]:
    with _one_thread():
        return [
            forms.assess(one.dose_h, one.ln_resistance, one.sd, degrees_of_freedom=one.degrees_of_freedom)
            for one in some
        ]


def _one_thread() -> threadpool_limits:
    """Products of so small matrices wait for a second thread longer than they take."""
    return threadpool_limits(1, user_api="blas")
