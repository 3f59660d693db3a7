"""The extended model beside the recalibrated one, in words: whether the sensors see a gain, what the coefficients no
longer have to do, where the two are apart, and what would tell which is right."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from ingest.texts.times import clock
from replay.show.reports import kept_errors, verdict
from replay.show.words import words
from replay.studies.diagnosis.answer import Diagnosis, KeptGain, Telling, TwoModels

TAKEN = 0.5  # of an error: what leaves less, recalibration or the cause, has taken most of it
ROSE_K = 0.02  # of the mean error over the nodes: less is no rise
TOLD_K = 0.1  # a place where the two models are less apart is not told


def notes(diagnosis: Diagnosis) -> list[str]:
    """What a reader must know before taking the extended files: a sentence where nothing improved, and one where they
    are further off than the file as published."""
    return list(filter(None, [_without_gain(diagnosis), _worse_than_published(diagnosis)]))


def _without_gain(diagnosis: Diagnosis) -> str:
    if not diagnosis.learnt or diagnosis.improved:
        return ""
    offer = "the extended files are offered all the same" if diagnosis.offers else "no file is changed"
    return f"{_no_gain(diagnosis)}; {offer}."


def _worse_than_published(diagnosis: Diagnosis) -> str:
    if not (diagnosis.gain and diagnosis.offers):
        return ""
    published, after = (_mean_K(diagnosis, stage) for stage in ("published", "after"))
    if after <= published:
        return ""
    now, was = words.figures([after, published])
    errors = f"{now} K instead of {was} K in the mean over the nodes"
    return f"The extended model is further off on the kept sessions than the file as published: {errors}."


def _no_gain(diagnosis: Diagnosis) -> str:
    if not diagnosis.held_out:
        return "No session was kept to measure the gain on"
    rises = [_rises_K(gain) for gain in diagnosis.gain]
    if not rises:
        return "The kept sessions are not predicted better with it"
    if max(map(_mean, zip(*rises, strict=True))) >= ROSE_K and max(map(max, rises)) >= kept_errors.WORSE_K:
        worst = max(diagnosis.gain, key=lambda gain: max(_rises_K(gain)))
        stages = ["before", "after"]
        errors = kept_errors.errors(worst, stages)
        if _rises_K(worst)[0] <= 0:  # only the fitted error rises: the other would say the opposite
            errors = f"fitted {kept_errors.chain(kept_errors.fitted(worst), stages)}"
        return f"With it the kept sessions get worse than recalibrated, most the {words.name(worst.node)}: {errors}"
    published, before = (_mean_K(diagnosis, stage) for stage in ("published", "before"))
    reasons = [cause.why_not_improved for cause in diagnosis.fitted_with]
    reasons += [heat.why_not_improved for heat in diagnosis.unknown]
    if _mean_K(diagnosis, "after") <= TAKEN * before and (why := next(filter(None, reasons), "")):
        return f"The kept sessions are nearer with it, but {why}"
    if before <= TAKEN * published:
        was, now = words.figures([published, before])
        return f"The sensors see no gain from it, as recalibration alone takes their mean error from {was} K to {now} K"
    return "The kept sessions are not predicted better with it"


def _rises_K(gain: KeptGain) -> tuple[float, float]:
    """How much larger the error is with the cause than recalibrated [K]: told first, and fitted."""
    told, fitted = _told_first(gain), kept_errors.fitted(gain)
    return told["after"] - told["before"], fitted["after"] - fitted["before"]


def _told_first(gain: KeptGain) -> Mapping[str, float]:
    """As `kept_errors.told_first`; fitted where no file was replayed with the cause."""
    told = kept_errors.told_first(gain, True)
    return told if "after" in told else kept_errors.fitted(gain)


def _mean_K(diagnosis: Diagnosis, stage: str) -> float:
    """Mean error over the nodes at a stage [K]."""
    return _mean([_told_first(gain)[stage] for gain in diagnosis.gain])


def _mean(values: Sequence[float]) -> float:
    return sum(values) / len(values)


def paragraphs(diagnosis: Diagnosis) -> list[str]:
    """What is said of the two models, a paragraph each; [] where nothing was named that a file can say."""
    found = diagnosis.two_models
    return list(filter(None, _told(diagnosis, found))) if found else []


def _told(diagnosis: Diagnosis, found: TwoModels) -> Iterator[str]:
    yield _relieved(found)
    yield _inside(diagnosis, found)
    yield _at_points(found)
    yield _telling(found)


def _relieved(found: TwoModels) -> str:
    """ "numbers that move less with the cause: conductance jacket-coolant −2.3 sd without it, −0.2 sd with it; ..."."""
    if not found.relieved:
        return "the cause relieves no coefficient by half of its sd or more"
    told = [f"{one.parameter} {_sd(one.before_sd)} without it, {_sd(one.after_sd)} with it" for one in found.relieved]
    return f"numbers that move less with the cause: {'; '.join(told)}"


def _sd(value: float) -> str:
    return f"{words.signed(value)} sd"


def _inside(diagnosis: Diagnosis, found: TwoModels) -> str:
    """The node without a sensor where the two are furthest apart."""
    if not found.inside:
        return "every node has a sensor: they differ nowhere unseen"
    one, where = found.inside[0], "kept sessions" if found.over_kept else "sessions learnt from"
    if one.mean_K < TOLD_K:
        return f"at nodes without a sensor the two agree within {words.kelvin(TOLD_K)} in the mean of the {where}"
    at = f"{verdict.session_name(diagnosis, one.session)} {clock(one.t_s)}"
    apart = f"{words.kelvin(one.mean_K)} in the mean of the {where}, {words.kelvin(one.max_K)} at most ({at})"
    return f"of the nodes without a sensor they differ most at {words.name(one.node)}: {apart}"


def _at_points(found: TwoModels) -> str:
    """The operating point where the two are furthest apart."""
    most = max(found.points, key=lambda point: abs(point.differ_K), default=None)
    if most is None:
        return ""
    points = words.counted(len(found.points), "operating point")
    if abs(most.differ_K) < TOLD_K:
        return f"at {points} the two agree within {words.kelvin(TOLD_K)}"
    apart = f"{words.name(most.node)} {words.signed_kelvin(most.differ_K)} with the cause"
    return f"of {points} they differ most at {most.says}: {apart}"


def _telling(found: TwoModels) -> str:
    """The test and the sensor that would tell which is right."""
    told = []
    if found.test:
        by = f"{found.test.channel} reads {words.signed_kelvin(found.test.differ_K)} with the cause"
        told.append(f"{found.test.says}, where {by}, {_times(found.test)} it may be off")
    if found.sensor:
        when = found.sensor.says or "more such sessions"
        apart = f"{words.kelvin(abs(found.sensor.differ_K))} apart in {when}"
        told.append(f"a sensor at {words.name(found.sensor.node)}, {apart}, {_times(found.sensor)} one may be off")
    if not told:
        return (
            "neither an operating point nor one more sensor would tell which is right: they differ too little "
            "everywhere for what a sensor may be off"
        )
    return f"would tell which is right: {'; or '.join(told)}"


def _times(one: Telling) -> str:
    return f"{one.times_sensor:.0f} times what"
