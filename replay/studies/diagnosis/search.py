"""The search over the training sessions, and what the kept ones say of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from replay.studies.diagnosis.answer_parts import place_of
from replay.studies.diagnosis.kept_sessions import Measured, measured
from replay.studies.diagnosis.question import Campaign
from twin.diagnosis.free_heats import Unknown, as_fitted, describe
from twin.diagnosis.naming import Naming, at_the_patchwork, heats_of, search, without_term
from twin.diagnosis.refined import Tell
from twin.diagnosis.rounds import EVIDENT, Refit
from twin.diagnosis.swaps import Swap, exchanged
from twin.differences.everyday import everyday
from twin.errors import DivergedError
from twin.fitting.fit import NEAR_ENOUGH, Fit, fit, fit_from_file
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
    base = _under_the_noise_of(naming.final, naming.rounds[0].base) if naming.learnt else naming.final
    result = None
    while kept:
        tell("predicting the kept sessions")
        result = measured(base, naming.final, straight, straight_kept, naming.learnt)
        if not naming.learnt or naming.judged or not _speak_against(naming, result, straight, straight_kept):
            break
        if naming.accepted:
            weakest = min(naming.accepted, key=lambda r: r.log_bayes_factor)
            refused.append((weakest, "it makes the kept sessions worse: form error of the sessions learnt from"))
            naming = _less(naming, weakest)
        else:
            naming = replace(naming, heat=None, final=naming.rounds[0].base)
        base = base if naming.learnt else naming.final
    unknown = _unknown(naming)
    if kept and swaps:
        crossed = supposing(Model(campaign.network, campaign.tests, model.parameters, naming.final.model.noise))
        base = fit_from_file(crossed)
        result = measured(base, naming.final, campaign.tests, kept, True, straight_kept)
    return Found(naming, refused, swaps, unknown, result, base)


def _speak_against(naming: Naming, result: Measured, train: Sequence[Test], kept: Sequence[Test]) -> bool:
    """Whether kept sessions get worse by the terms, held against the fit that has the heat without a name too that
    stands beside them; without terms, by this heat."""
    if naming.heat is None or not naming.accepted:
        return result.worse
    before = _under_the_noise_of(naming.final, naming.searched[0].base)
    return measured(before, naming.final, train, kept, True).worse


def _less(naming: Naming, refused: Refit) -> Naming:
    """The naming without one term; without any, as if none had been looked for beside a heat in time without a name."""
    left = tuple(r for r in naming.accepted if r is not refused)
    if not left and naming.heat and not naming.heat.is_map:
        return replace(naming, accepted=(), heat=None, final=naming.rounds[0].base)
    final = without_term(naming.final, place_of(naming.final, refused), naming.rounds[0].base.beta)
    return replace(naming, accepted=left, final=final)


def _under_the_noise_of(final: Fit, found: Fit) -> Fit:
    return fit(found.model.with_noise(final.model.noise), found.beta, enough=NEAR_ENOUGH)


def _unknown(naming: Naming) -> list[Unknown]:
    """The heat beside which terms were named, that wins over every candidate, or stands where only patchwork fits; else
    what is left beside the named terms."""
    if naming.heat:
        return [describe(naming.final, as_fitted(naming.final, naming.heat))]
    if naming.patchwork:
        return [describe(naming.final, at_the_patchwork(naming))]
    if naming.is_unknown:
        return [describe(naming.final, naming.heats[0])]
    if naming.accepted:
        try:
            left = heats_of(naming.final, naming.wrong_in_form)[0]
        except DivergedError:  # terms that grow with temperature, held just below where they run away
            return []
        if left.log_bayes_factor > EVIDENT:
            return [describe(naming.final, left)]
    return []
