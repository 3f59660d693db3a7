"""The search over the training sessions, and what the kept ones say of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from replay.studies.answer_parts import place_of
from replay.studies.kept_sessions import Measured, measured
from replay.studies.question import Campaign
from twin.columns import Reading
from twin.everyday import everyday
from twin.fit import NEAR_ENOUGH, Fit, fit
from twin.free_heats import Unknown, describe, free_heats
from twin.model import Model, Test
from twin.naming import Naming, Refit, search
from twin.swaps import Swap, exchanged

Tell = Callable[[str], None]


@dataclass(frozen=True)
class Found:
    """What the search left: its naming, terms that kept sessions spoke against, exchanged channels, and free heats."""

    naming: Naming
    refused: list[tuple[Refit, str]]
    swaps: list[Swap]
    unknown: list[Unknown]
    log_bf_unknown: float
    kept: Measured | None
    base: Fit


def find(campaign: Campaign, model: Model, swaps: list[Swap], kept: list[Test], tell: Tell) -> Found:
    """Search, ask whether an unknown heat explains more, and let the kept sessions speak against what makes them worse."""
    straight, straight_kept = campaign.tests, kept
    for swap in swaps:
        column = swap.candidate.column
        assert isinstance(column, Reading)
        straight = exchanged(straight, column.channel, column.other)
        straight_kept = list(exchanged(straight_kept, column.channel, column.other))
    if swaps:
        model = Model(campaign.network, straight, everyday(campaign.network, straight))
    naming = search(model, campaign.candidates, tell)
    best, unknown = naming.heats[0], list[Unknown]()
    if naming.is_unknown:
        unknown = [describe(naming.final, best)]
    elif naming.accepted:
        after = free_heats(naming.final)[0]
        if after.log_bayes_factor > naming.threshold:
            unknown = [describe(naming.final, after)]
    refused: list[tuple[Refit, str]] = []
    base = _baseline(naming)
    result = None
    while kept:
        tell("predicting the kept sessions")
        result = measured(base, naming.final, straight, straight_kept, bool(naming.accepted))
        if not naming.accepted or not result.worse:
            break
        weakest = min(naming.accepted, key=lambda r: r.log_bayes_factor)
        refused.append((weakest, "it makes the kept sessions worse: form error of the sessions learnt from"))
        final = naming.final
        place = place_of(final, weakest)
        final = fit(final.model.without(place), np.delete(final.beta, place), enough=NEAR_ENOUGH)
        naming = replace(naming, accepted=tuple(r for r in naming.accepted if r is not weakest), final=final)
    if kept and swaps:
        crossed = Model(campaign.network, campaign.tests, model.parameters, naming.final.model.noise)
        base = fit(crossed, np.zeros(len(model.parameters)), enough=NEAR_ENOUGH)
        result = measured(base, naming.final, campaign.tests, kept, True, straight_kept)
    return Found(naming, refused, swaps, unknown, best.log_bayes_factor, result, base)


def _baseline(naming: Naming) -> Fit:
    """The fit without any named term, under the noise of the final one."""
    first = naming.rounds[0].base
    if not naming.accepted:
        return naming.final
    return fit(first.model.with_noise(naming.final.model.noise), first.beta, enough=NEAR_ENOUGH)
