"""Naming: which terms the data ask for, one after the other, beyond all that a healthy motor may do, and which survive.

The motor is calibrated under broad noise, then under fitted noise. Every candidate is scored with all else integrated
out; where a free heat at one node explains more than any of them, nothing is named. Else the leading ones are refitted
in full, and the one that leads at the file's own values, from there; the best enters where it beats the threshold, and
at the end every one that entered is left out once. Where none is left and a free heat beats the threshold, the cause is
unknown: what candidates seemed to explain no longer stands against it.

Where what is left is no larger than a lumped model's own error, evidence judges alone: a session left out is another
kind of test, which any freer law helps. Where it is far above that, the file's form is wrong, and the same samples that
make evidence do not make truth: there a term enters only where each session, predicted from the others, allows it and
all together ask for it, and of several the one that they ask for most. Fewer than four sessions cannot say that; there
the leading term is the only one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from twin.diagnosis.free_heats import free_heats
from twin.diagnosis.patchwork import Survivor, is_patchwork
from twin.diagnosis.posterior_mode import is_wrong_in_form
from twin.diagnosis.refined import Tell, calibrated, refined
from twin.diagnosis.rounds import (
    EVIDENT,
    REFIT_LINEARISATIONS,
    THRESHOLD,
    Refit,
    Round,
    compared,
    scored,
    uncalibrated,
    with_refits,
)
from twin.diagnosis.unknown import FreeHeat
from twin.differences.candidates import Candidate
from twin.errors import DivergedError
from twin.fitting.actions import Parameter
from twin.fitting.fit import NEAR_ENOUGH, Fit, fit
from twin.fitting.model import Floats, Model

MOST_TERMS = 5  # by evidence alone
ENOUGH_SESSIONS = 4  # of a file whose form is wrong: fewer do not say what holds on a session left out


@dataclass(frozen=True)
class Naming:
    """`rounds` in the order of the search; the last one found nothing more, or the most terms were reached. `accepted`:
    the terms that survived, with ln BF of leaving each out; `final`: the fit with them; `left_out`: terms that did not
    survive, with theirs; `heats`: free heats about the first fit, highest ln BF first; `patchwork`: terms that survived
    only together, none of them named; whether what is left says that the file's form is wrong (`wrong_in_form`)."""

    rounds: tuple[Round, ...]
    accepted: tuple[Refit, ...]
    left_out: tuple[tuple[Candidate, float], ...]
    final: Fit
    heats: tuple[FreeHeat, ...]
    threshold: float
    patchwork: tuple[Refit, ...] = ()
    wrong_in_form: bool = False

    @property
    def judged(self) -> bool:
        """Whether sessions left out had to hold for each term."""
        return self.wrong_in_form and not self.few_sessions

    @property
    def few_sessions(self) -> bool:
        """Whether the file's form is wrong and sessions are too few to leave any out."""
        return self.wrong_in_form and len(self.final.model.tests) < ENOUGH_SESSIONS

    @property
    def is_unknown(self) -> bool:
        """Whether a heat of any course explains more than every candidate that came to anything (`best`), or only
        patchwork fits."""
        return bool(self.patchwork) or self.log_bf_unknown > max(EVIDENT, self.best)

    @property
    def best(self) -> float:
        """The highest ln BF of a candidate by its linear score; 0 where leading ones were refitted and none was let
        in, for what they seemed to explain stands against them."""
        if self.rounds[0].refits and not self.accepted:
            return 0.0
        return float(self.rounds[0].scores.log_bayes_factor.max(initial=0.0))

    @property
    def log_bf_unknown(self) -> float:
        """ln BF of the best free heat."""
        return self.heats[0].log_bayes_factor


def search(
    model: Model, candidates: Sequence[Candidate], tell: Tell = lambda _: None, threshold: float | None = None
) -> Naming:
    """Find the terms. `threshold`: the ln BF that each must exceed, if not THRESHOLD, or EVIDENT where sessions left
    out judge. Raises `DivergedError` where the model itself runs away."""
    tell("calibrating")
    current = calibrated(model, candidates, tell)
    tell("scoring")
    first = scored(current, candidates)
    tell("looking for heat that no candidate explains")
    wrong = is_wrong_in_form(current.model)
    found = Naming((first,), (), (), current, free_heats(current), THRESHOLD, wrong_in_form=wrong)
    judging = found.judged
    threshold = (EVIDENT if judging else THRESHOLD) if threshold is None else threshold
    found = replace(found, threshold=threshold)
    if found.is_unknown:
        return found
    most = 1 if found.few_sessions else len(candidates) if judging else MOST_TERMS
    first = with_refits(first, tell, uncalibrated(current, len(model.parameters)), judging)
    rounds = [first]
    accepted: list[tuple[Candidate, Parameter]] = []
    while True:
        best = rounds[-1].best
        if best is None or best.log_bayes_factor <= max(threshold, rounds[-1].null) or len(accepted) == most:
            break
        accepted.append((best.candidate, best.parameter))
        rounds[-1].forget()
        current = refined(best.fit, candidates, model.parameters, tell)
        tell("scoring")
        left = [c for c in candidates if c not in [a for a, _ in accepted]]
        rounds.append(with_refits(scored(current, left), tell, judging=judging))
    tell("leaving out")
    found = _eliminated(replace(found, rounds=tuple(rounds), final=current), accepted, model)
    survivors = [Survivor(r.candidate, r.log_bayes_factor, first.alone(r.candidate)) for r in found.accepted]
    if not judging and is_patchwork(survivors, model.network):
        return replace(found, accepted=(), patchwork=found.accepted, final=first.base)
    return found


def without_term(current: Fit, place: int, calm: Floats) -> Fit:
    """The fit without one term, from where the others are, or, where that runs away, from the first fit `calm`."""
    model = current.model.without(place)
    try:
        return fit(model, np.delete(current.beta, place), NEAR_ENOUGH, REFIT_LINEARISATIONS)
    except DivergedError:
        return fit(model, np.append(calm, np.zeros(len(model.parameters) - len(calm))), enough=NEAR_ENOUGH)


def _eliminated(found: Naming, accepted: list[tuple[Candidate, Parameter]], model: Model) -> Naming:
    """Leave every term out once, both sides fitted; the weakest goes while it is under the threshold."""
    left_out: list[tuple[Candidate, float]] = []
    current = found.final
    while accepted:
        each = []
        for i, (candidate, parameter) in enumerate(accepted):
            place = len(model.parameters) + i
            without = without_term(current, place, found.rounds[0].base.beta)
            each.append((compared(current, without, candidate, parameter, place), without))
        weakest = min(range(len(each)), key=lambda i: each[i][0].log_bayes_factor)
        if each[weakest][0].log_bayes_factor > found.threshold:
            return replace(found, accepted=tuple(c for c, _ in each), left_out=tuple(left_out), final=current)
        left_out.append((accepted[weakest][0], each[weakest][0].log_bayes_factor))
        current = each[weakest][1]
        del accepted[weakest]
    return replace(found, left_out=tuple(left_out), final=current)
