"""What is unusual in the calibrated motor, told before any cause: the twin's findings as the answer holds them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from replay.studies.diagnosis.answer import Unusual
from twin.diagnosis.findings import Elsewhere, Findings, Moved, Wide, findings
from twin.diagnosis.in_words import Plain
from twin.diagnosis.naming import Naming
from twin.diagnosis.rounds import EVIDENT
from twin.differences.everyday import everyday
from twin.fitting.fit import Fit
from twin.motor.causes import place_words


def beyond_usual(naming: Naming, train: Sequence[str]) -> list[Unusual]:
    """What is unusual in the first fit, and in the one with what was learnt where there is any. `train`: the ids of the
    sessions learnt from."""
    fits = {"before": naming.rounds[0].base} | ({"after": naming.final} if naming.learnt else {})
    return [one for when, fit in fits.items() for one in _of(fit, when, train, EVIDENT)]


def _of(fit: Fit, when: str, train: Sequence[str], threshold: float) -> Iterator[Unusual]:
    """Families first, then single numbers, then temperatures where no sensor sits, in each the strongest first."""
    found = findings(fit, everyday(fit.model.network, fit.model.tests), threshold)
    plain = Plain(fit.model.network)
    yield from (_wide(found, one, when, plain) for one in found.wide)
    yield from (_moved(found, one, when, plain, train) for one in found.moved)
    yield from (_elsewhere(one, when, train) for one in found.elsewhere)


def _wide(found: Findings, one: Wide, when: str, plain: Plain) -> Unusual:
    parameter, *others = (found.fit.model.parameters[i] for i in one.members)
    return Unusual(
        about="family",
        when=when,
        kind=plain.kind_and_place(parameter)[0],
        says=plain.group(parameter),
        times_usual=one.times,
        log_evidence=one.log_evidence,
        sharper=plain.sharper(parameter, *others),  # losses of several regions have several tests
    )


def _moved(found: Findings, one: Moved, when: str, plain: Plain, train: Sequence[str]) -> Unusual:
    parameter, value = found.fit.model.parameters[one.place], float(found.fit.beta[one.place])
    kind, place = plain.kind_and_place(parameter)
    estimate, unit = plain.amount(parameter, value)
    band = [plain.amount(parameter, value + times * one.sd)[0] for times in (-1.96, 1.96)]
    return Unusual(
        about="bound" if one.held else "moved",
        when=when,
        kind=kind,
        place=place,
        says=plain.says(parameter),
        session=None if parameter.test is None else train[parameter.test],
        times_usual=one.usual,
        estimate=estimate,
        ci95=band,
        unit=unit,
        bound=plain.bound(parameter) if one.held else None,
        sharper=plain.sharper(parameter),
    )


def _elsewhere(one: Elsewhere, when: str, train: Sequence[str]) -> Unusual:
    return Unusual(
        about="moved",
        when=when,
        kind="temperature",
        place=one.node,
        says=f"the temperature of {place_words(one.node)}, where no sensor sits",
        session=train[one.test],
        times_usual=one.usual,
        estimate=one.hotter_K,
        ci95=[one.hotter_K + times * one.sd for times in (-1.96, 1.96)],
        unit="K",
        sharper="a sensor there",
    )
