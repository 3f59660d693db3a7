"""The search over the training sessions, and what the kept ones say of it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from replay.studies.diagnosis.answer_parts import place_of
from replay.studies.diagnosis.kept_sessions import Measured, measured
from replay.studies.diagnosis.question import Campaign
from twin.diagnosis.free_heats import Unknown, describe, free_heats
from twin.diagnosis.naming import Naming, search, without_term
from twin.diagnosis.patchwork import nodes_of
from twin.diagnosis.refined import Tell
from twin.diagnosis.rounds import EVIDENT, Refit
from twin.diagnosis.swaps import Swap, exchanged
from twin.diagnosis.unknown import FreeHeat
from twin.differences.everyday import everyday
from twin.errors import DivergedError
from twin.fitting.fit import NEAR_ENOUGH, Fit, fit
from twin.fitting.model import Model, Test
from twin.fitting.supposed import supposing


@dataclass(frozen=True)
class Found:
    """What the search left: its naming; `refused`, terms that the kept sessions spoke against, and how; exchanged
    channels; `unknown` heats; what the kept sessions say; and `base`, the fit without any named term."""

    naming: Naming
    refused: list[tuple[Refit, str]]
    swaps: list[Swap]
    unknown: list[Unknown]
    kept: Measured | None
    base: Fit


def find(campaign: Campaign, model: Model, swaps: list[Swap], kept: list[Test], tell: Tell) -> Found:
    """Search, drop terms that make the kept sessions worse, and ask whether an unknown heat explains more. Where
    sessions left out judged each term, the kept ones are opened once, and none is dropped."""
    straight, straight_kept = campaign.tests, kept
    for swap in swaps:
        both = exchanged([*straight, *straight_kept], swap.pair.channel, swap.pair.other)
        straight, straight_kept = both[: len(straight)], list(both[len(straight) :])
    if swaps:
        model = Model(campaign.network, straight, everyday(campaign.network, straight))
    naming = search(model, campaign.candidates, tell)
    refused: list[tuple[Refit, str]] = []
    base = _baseline(naming)
    result = None
    while kept:
        tell("predicting the kept sessions")
        result = measured(base, naming.final, straight, straight_kept, bool(naming.accepted))
        if not naming.accepted or not result.worse or naming.judged:
            break
        weakest = min(naming.accepted, key=lambda r: r.log_bayes_factor)
        refused.append((weakest, "it makes the kept sessions worse: form error of the sessions learnt from"))
        final = without_term(naming.final, place_of(naming.final, weakest), naming.rounds[0].base.beta)
        naming = replace(naming, accepted=tuple(r for r in naming.accepted if r is not weakest), final=final)
    unknown = _unknown(naming)
    if kept and swaps:
        crossed = supposing(Model(campaign.network, campaign.tests, model.parameters, naming.final.model.noise))
        base = fit(crossed, np.zeros(len(model.parameters)), enough=NEAR_ENOUGH)
        result = measured(base, naming.final, campaign.tests, kept, True, straight_kept)
    return Found(naming, refused, swaps, unknown, result, base)


def _baseline(naming: Naming) -> Fit:
    """The fit without any named term, under the noise of the final one."""
    first = naming.rounds[0].base
    if not naming.accepted:
        return naming.final
    return fit(first.model.with_noise(naming.final.model.noise), first.beta, enough=NEAR_ENOUGH)


def _unknown(naming: Naming) -> list[Unknown]:
    """The heat that wins over every candidate, or stands where only patchwork fits; else what is left beside the named
    terms."""
    if naming.patchwork:
        return [describe(naming.final, _at_the_patchwork(naming))]
    if naming.is_unknown:
        return [describe(naming.final, naming.heats[0])]
    if naming.accepted:
        try:
            left = free_heats(naming.final)[0]
        except DivergedError:  # terms that grow with temperature, held just below where they run away
            return []
        if left.log_bayes_factor > EVIDENT:
            return [describe(naming.final, left)]
    return []


def _at_the_patchwork(naming: Naming) -> FreeHeat:
    """The free heat with most evidence where the patchwork acts, with what the patchwork's strongest term has for
    it."""
    network = naming.final.model.network
    nodes = frozenset[str]().union(*(nodes_of(refit.candidate, network) for refit in naming.patchwork))
    strongest = max(refit.log_bayes_factor for refit in naming.patchwork)
    return replace(next(h for h in naming.heats if h.node in nodes), log_bayes_factor=strongest)
