"""Naming: which terms the data ask for, one after the other, beyond all that a healthy motor may do, and which survive.

The motor is calibrated under broad noise, then under fitted noise. Every candidate is scored with all else integrated
out; where a free heat at one node, in time or over speed and load, explains more than any of them, nothing is named.
Else the leading ones are refitted in full, and the one that leads at the file's own values, from there; the best enters
where it beats the threshold, and at the end every one that entered is left out once. Where none is left and a free heat
beats the threshold, the cause is unknown: what candidates seemed to explain no longer stands against it.

A motor with an unknown heat may have causes beside it. There the search goes on once, elsewhere in the motor and on the
bench, with this heat among the parameters: what it hides or bends shows, and what sessions that are run without it had
against a term goes. At its own place a term would only stand in for it.

Where what is left is no larger than a lumped model's own error, evidence judges alone: a session left out is another
kind of test, which any freer law helps. Where it is far above that, the file's form is wrong, and the same samples that
make evidence do not make truth: there a term enters only where sessions, each predicted from the others, are nearer
with it by more than the standard error of that, and together ask for it; of several the one with which they are
nearest. The search ends where nothing more holds: the same sessions asked again and again wear out, and a gain within
their scatter is what is left of them. A heat of any course says nothing of a session that is left out, so nothing is
looked for beside it there; last they are asked about a loss over speed and load that no term has. Fewer than four
sessions cannot judge; there the leading term is the only one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from twin.diagnosis.crudeness import crudeness, listed
from twin.diagnosis.evidence import TOLD_APART
from twin.diagnosis.free_heats import as_parameters, free_heats, free_maps, knots_of, places_of_heat
from twin.diagnosis.free_maps import Knots
from twin.diagnosis.left_out import LeftOut, left_out
from twin.diagnosis.patchwork import Survivor, around, is_patchwork, nodes_of
from twin.diagnosis.posterior_mode import is_wrong_in_form
from twin.diagnosis.refined import Tell, calibrated, refined, under_its_noise
from twin.diagnosis.rounds import (
    EVIDENT,
    REFIT_LINEARISATIONS,
    THRESHOLD,
    Refit,
    Round,
    against,
    compared,
    scored,
    uncalibrated,
    with_refits,
)
from twin.diagnosis.unknown import FreeHeat
from twin.differences.candidates import Candidate
from twin.differences.everyday import everyday
from twin.errors import DivergedError
from twin.fitting.actions import Parameter
from twin.fitting.fit import NEAR_ENOUGH, Fit, fit
from twin.fitting.model import Floats, Model

MOST_TERMS = 5  # by evidence alone
MAPS_ASKED = 3  # sessions left out are asked about so many
ENOUGH_SESSIONS = 4  # of a file whose form is wrong: fewer do not say what holds on a session left out


@dataclass(frozen=True)
class Naming:
    """`rounds` in the order of the search; the last one found nothing more, or the most terms were reached. `accepted`:
    the terms that survived, with ln BF of leaving each out; `final`: the fit with them; `left_out`: terms that did not
    survive, with theirs; `heats`: free heats about the first fit, highest ln BF first; `patchwork`: terms that survived
    only together, none of them named; whether what is left says that the file's form is wrong (`wrong_in_form`);
    `heat`: one without a name that stands among the parameters of `final`, as found first: a map, which is a part of
    the motor as all sessions have it in common, or one `beside` which terms were looked for. Then the rounds from the
    second on have it too."""

    rounds: tuple[Round, ...]
    accepted: tuple[Refit, ...]
    left_out: tuple[tuple[Candidate, float], ...]
    final: Fit
    heats: tuple[FreeHeat, ...]
    threshold: float
    patchwork: tuple[Refit, ...] = ()
    wrong_in_form: bool = False
    heat: FreeHeat | None = None
    beside: bool = False

    @property
    def learnt(self) -> bool:
        """Whether `final` is more than the recalibrated motor: it has terms, or a heat without a name."""
        return bool(self.accepted) or self.heat is not None

    @property
    def map_id(self) -> str | None:
        """The id of the heat that has no name as a term of a motor file; None where it is no map."""
        return f"loss.{self.heat.node}.map" if self.heat and self.heat.is_map else None

    @property
    def map_said(self) -> str | None:
        """`map_id` where a motor file can say the map."""
        return self.map_id if self.map_id and knots_of(self.final.model).sayable else None

    @property
    def judged(self) -> bool:
        """Whether sessions left out had to hold for each term."""
        return self.wrong_in_form and not self.few_sessions

    @property
    def few_sessions(self) -> bool:
        """Whether the file's form is wrong and sessions are too few to leave any out."""
        return self.wrong_in_form and len(self.final.model.tests) < ENOUGH_SESSIONS

    @property
    def needed(self) -> float:
        """The ln BF that a term must exceed, if nobody says another."""
        return EVIDENT if self.judged else THRESHOLD

    @cached_property
    def crudeness(self) -> float:
        """How crude the file is, less what the terms relieve its numbers of (`twin.diagnosis.crudeness`)."""
        model = self.final.model
        return crudeness(self.final, everyday(model.network, model.tests))

    @property
    def listed(self) -> float:
        """How probable it is that what stands out is one of the candidates, and not the form of a crude file."""
        return listed(self.crudeness)

    @property
    def searched(self) -> tuple[Round, ...]:
        """The rounds that let the terms in: without the first where they were looked for beside a heat."""
        return self.rounds[1:] if self.beside else self.rounds

    def entered(self, candidate: Candidate) -> Round:
        """The round in which a term was let in."""
        led = (one for one in self.searched if (best := one.best) and best.candidate == candidate)
        return next(led, self.searched[0])

    @property
    def is_unknown(self) -> bool:
        """Whether a heat of any course explains more than every candidate that came to anything (`best`), by ln 20 at
        least, or only patchwork fits, or such a heat stands among the parameters."""
        return bool(self.patchwork) or self.heat is not None or self.log_bf_unknown > max(TOLD_APART, self.best)

    @property
    def best(self) -> float:
        """The highest ln BF of a candidate by its linear score. Where leading ones were refitted and none was let in by
        evidence, what they seemed to explain no longer stands against anything, but for what is no more than the file's
        own form may do. Where sessions left out let none in, no heat of any course predicts these either."""
        if self.rounds[0].refits and not self.accepted and not self.judged:
            return self.rounds[0].form
        return float(self.rounds[0].scores.log_bayes_factor.max(initial=0.0))

    @property
    def log_bf_instead(self) -> float:
        """ln BF of a heat without a name in place of the terms: none where they stand beside it, and no more than 0
        where sessions left out judge, for a heat of any course predicts none of them."""
        return -math.inf if self.heat else min(0.0, self.log_bf_unknown) if self.judged else self.log_bf_unknown

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
    found = Naming((first,), (), (), current, heats_of(current, wrong), THRESHOLD, wrong_in_form=wrong)
    judging = found.judged
    found = replace(found, threshold=found.needed if threshold is None else threshold)
    if not found.is_unknown:
        first = with_refits(first, _of_cause(1, tell), uncalibrated(current, len(model.parameters)), judging)
        found = _searched(replace(found, rounds=(first,)), candidates, model.parameters, tell)
        if _is_patchwork(found):
            found = replace(found, accepted=(), patchwork=found.accepted, final=first.base)
    if found.is_unknown and not judging:
        return _beside_heat(found, candidates, model.parameters, tell)
    return _and_a_map(found, candidates, model.parameters, tell)


def heats_of(current: Fit, wrong_in_form: bool) -> tuple[FreeHeat, ...]:
    """The free heats about a fit, highest ln BF first. Without maps where the file's form is wrong: evidence for one
    would only say so again, and sessions left out are asked instead (`_and_a_map`)."""
    return free_heats(current, maps=not wrong_in_form)


def _and_a_map(found: Naming, candidates: Sequence[Candidate], stated: Sequence[Parameter], tell: Tell) -> Naming:
    """Beside the terms a loss over speed and load that no term has, and the terms that show beside it, where sessions
    left out judge and let it in."""
    if not found.judged or found.heat or not (held := _map_that_holds(found.final, candidates, tell)):
        return found
    heat, current = held
    left = _left(candidates, [one.candidate for one in found.accepted])
    again = with_refits(scored(current, left), _of_cause(len(found.accepted) + 1, tell), judging=True)
    return _searched(replace(found, rounds=(*found.rounds, again), heat=heat), candidates, stated, tell)


def _searched(found: Naming, candidates: Sequence[Candidate], stated: Sequence[Parameter], tell: Tell) -> Naming:
    """Term after term beside those that were let in, from the last of the rounds on, then every one of them left out
    once. `stated`: the parameters of the model without any term."""
    most = 1 if found.few_sessions else len(candidates) if found.judged else MOST_TERMS
    rounds = list(found.rounds)
    current = rounds[-1].base
    accepted = [(one.candidate, one.parameter) for one in found.accepted]
    while True:
        best = rounds[-1].best
        if best is None or best.log_bayes_factor <= max(found.threshold, rounds[-1].null) or len(accepted) == most:
            break
        tell_next = _of_cause(len(accepted) + 2, tell)
        with_it = refined(best.fit, candidates, stated, tell_next)
        best.fit.model.forget()
        if found.judged:
            rounds[-1] = again = rounds[-1].asked_again(best, with_it)
            if again.best is None or again.best.candidate is not best.candidate:
                continue
        current = with_it
        accepted.append((best.candidate, best.parameter))
        rounds[-1].base.model.forget()
        tell_next("scoring")
        left = _left(candidates, [candidate for candidate, _ in accepted])
        rounds.append(with_refits(scored(current, left), tell_next, judging=found.judged))
    tell("leaving each cause out once")
    return _eliminated(replace(found, rounds=tuple(rounds), final=current), accepted)


def _left(candidates: Sequence[Candidate], taken: Sequence[Candidate]) -> list[Candidate]:
    return [c for c in candidates if c not in taken]


def _map_that_holds(current: Fit, candidates: Sequence[Candidate], tell: Tell) -> tuple[FreeHeat, Fit] | None:
    """The free loss map with which sessions left out are nearest, and the fit with it: of those that evidence would let
    in, where it holds as a term must, and again under noise that is learnt with it. None where none does, or where no
    motor file could say it."""
    knots = Knots.of(current.model.tests)
    if knots is None or not knots.sayable:
        return None
    tell("looking for a loss over speed and load that no candidate says")
    before = left_out(current)
    best: tuple[FreeHeat, Fit, LeftOut] | None = None
    for heat in free_maps(current)[:MAPS_ASKED]:
        if heat.log_bayes_factor <= EVIDENT:
            break
        try:
            found = _with_heat(current, heat)
        except DivergedError:
            continue
        said = left_out(found)
        found.model.forget()
        if against(before, said) is None and (best is None or said.mean_K() < best[2].mean_K()):
            best = heat, found, said
    if best is None:
        return None
    with_it = under_its_noise(best[1], candidates)
    return None if before.is_as_near_as(left_out(with_it)) else (best[0], with_it)


def _of_cause(number: int, tell: Tell) -> Tell:
    """Which cause the search is at, before what it does for it."""
    return lambda line: tell(f"cause {number}: {line}")


def _is_patchwork(found: Naming) -> bool:
    """Whether the terms that survived by evidence only together stand in for a law that no candidate has."""
    first = found.rounds[0]
    survivors = [Survivor(r.candidate, r.log_bayes_factor, first.alone(r.candidate)) for r in found.accepted]
    return not found.judged and is_patchwork(survivors, found.final.model.network)


def _beside_heat(found: Naming, candidates: Sequence[Candidate], stated: Sequence[Parameter], tell: Tell) -> Naming:
    """What is named away from a heat that has no name: the search with this heat among the parameters. Where nothing is
    named so, a map stays among them all the same, and a heat in time goes. As it was where the motor runs away."""
    first = found.rounds[0].base
    heat = at_the_patchwork(found) if found.patchwork else found.heats[0]
    network = first.model.network
    near = around(frozenset({heat.node}), network)
    elsewhere = [c for c in candidates if not near & nodes_of(c, network)]
    tell("looking beside the heat that has no name")
    try:
        current = refined(_with_heat(first, heat), candidates, stated, tell)
        wrong = found.wrong_in_form and is_wrong_in_form(current.model)
        fresh = with_refits(scored(current, elsewhere), _of_cause(1, tell))
        again = replace(found, rounds=(fresh,), patchwork=(), left_out=(), wrong_in_form=wrong)
        beside = _searched(again, elsewhere, stated, tell)
    except DivergedError:
        return found
    if beside.accepted and not _is_patchwork(beside):
        rounds = (found.rounds[0], *beside.rounds)
        return replace(beside, rounds=rounds, patchwork=found.patchwork, heat=heat, beside=True)
    return replace(found, final=current, heat=heat) if heat.is_map else found


def _with_heat(current: Fit, heat: FreeHeat) -> Fit:
    """The fit with a free heat among its parameters, from where the others are."""
    parts = as_parameters(current, heat)
    return fit(current.model.plus(parts), np.append(current.beta, np.zeros(len(parts))), NEAR_ENOUGH)


def without_heat(current: Fit) -> Fit:
    """The fit without the heat that has no name, from where the others are."""
    parts = places_of_heat(current.model)
    return fit(current.model.without(*parts), np.delete(current.beta, parts), NEAR_ENOUGH, REFIT_LINEARISATIONS)


def without_term(current: Fit, place: int, calm: Floats) -> Fit:
    """The fit without one term, from where the others are, or, where that runs away, from the first fit `calm`."""
    model = current.model.without(place)
    try:
        return fit(model, np.delete(current.beta, place), NEAR_ENOUGH, REFIT_LINEARISATIONS)
    except DivergedError:
        return fit(model, np.append(calm, np.zeros(len(model.parameters) - len(calm))), enough=NEAR_ENOUGH)


def _eliminated(found: Naming, accepted: list[tuple[Candidate, Parameter]]) -> Naming:
    """Leave every term out once, both sides fitted; the weakest goes while it is under the threshold."""
    went = list(found.left_out)
    current = found.final
    while accepted:
        each = []
        for candidate, parameter in accepted:
            place = current.model.parameters.index(parameter)
            without = without_term(current, place, found.rounds[0].base.beta)
            each.append((compared(current, without, candidate, parameter, place), without))
        weakest = min(range(len(each)), key=lambda i: each[i][0].log_bayes_factor)
        if each[weakest][0].log_bayes_factor > found.threshold:
            return replace(found, accepted=tuple(c for c, _ in each), left_out=tuple(went), final=current)
        went.append((accepted[weakest][0], each[weakest][0].log_bayes_factor))
        current = each[weakest][1]
        del accepted[weakest]
    return replace(found, accepted=(), left_out=tuple(went), final=current)


def at_the_patchwork(naming: Naming) -> FreeHeat:
    """The free heat with most evidence where the patchwork acts, with what the patchwork's strongest term has for
    it."""
    network = naming.final.model.network
    nodes = frozenset[str]().union(*(nodes_of(refit.candidate, network) for refit in naming.patchwork))
    strongest = max(refit.log_bayes_factor for refit in naming.patchwork)
    return replace(next(h for h in naming.heats if h.node in nodes), log_bayes_factor=strongest)
