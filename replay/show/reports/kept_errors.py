"""Errors on kept sessions in words, the same for every sentence, table and plot: replayed, against readings as
recorded, and beside that with what a prediction fits on the first tenth of each session."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from replay.show.words import words
from replay.show.words.findings import MOVED_K
from replay.studies.diagnosis.answer import Diagnosis, KeptGain, calibration_is_worse

STAGES: Mapping[str, str] = {"published": "as published", "before": "recalibrated", "after": "with the cause"}
FITTED = "start, coolant and readings fitted on the first tenth of each kept session"
HOW = f"replayed, against readings as recorded; fitted: with {FITTED}"
HOW_MOVED = "; reading moved: by learnt corrections, in the mean"
WORSE_K = 0.1  # an error that rose by less stayed


def stages(named: bool) -> list[str]:
    """Keys of STAGES: with a cause where one was `named`."""
    return list(STAGES)[: 2 + named]


def fitted(gain: KeptGain) -> dict[str, float]:
    """Stage -> mean error [K] with what is FITTED, against corrected readings."""
    return dict(zip(STAGES, (gain.published_mae_K, gain.mae_before_K, gain.mae_after_K), strict=True))


def replayed(gain: KeptGain) -> bool:
    """Whether there were files to replay, whose errors then are told first."""
    return "before" in gain.mae_recorded_K


def told_first(gain: KeptGain, named: bool) -> dict[str, float]:
    """Stage -> mean error [K] as recorded, as far as files say the stages; fitted where there were none to replay."""
    known = gain.mae_recorded_K if replayed(gain) else fitted(gain)
    return {stage: known[stage] for stage in stages(named) if stage in known}


def moved(gain: KeptGain) -> str:
    """ "reading moved by −1.4 K": what learnt corrections add in the mean; "" where that is next to nothing."""
    told = abs(gain.reading_moved_K) >= MOVED_K
    return f"reading moved by {words.signed_kelvin(gain.reading_moved_K)}" if told else ""


def how(gains: Sequence[KeptGain]) -> str:
    """What the errors of these nodes are, as they are told: a legend of what is said of them, and of nothing else."""
    return HOW + HOW_MOVED * any(moved(gain) for gain in gains)


def errors(gain: KeptGain, of: Sequence[str], *more: str) -> str:
    """ "8.1 -> 1.4 K (fitted 7.0 -> 0.4 K)" at the stages `of`; "–" where no file says a stage. `more`: what else is to
    be said of the fitted ones."""
    beside = ", ".join(filter(None, [f"fitted {chain(fitted(gain), of)}", *more]))
    known = any(stage in gain.mae_recorded_K for stage in of)
    return f"{chain(gain.mae_recorded_K, of)} ({beside})" if known else beside


def chain(errors_K: Mapping[str, float], of: Sequence[str]) -> str:
    """ "8.1 -> 1.4 K", "–" where a stage is not known."""
    return f"{words.became([errors_K.get(stage) for stage in of])} K"


def furthest_first(gains: Sequence[KeptGain]) -> list[KeptGain]:
    """Nodes by their error as published, the largest first."""
    return sorted(gains, key=lambda gain: -told_first(gain, False)["published"])


def change(gain: KeptGain) -> str:
    """ "better", "worse" or "unchanged" with the cause: what the whole interval of the difference says."""
    low, high = sorted(gain.ci95_K)
    if low > 0:
        return "better"
    return "worse" if high < 0 else "unchanged"


def stayed(gain: KeptGain) -> bool:
    """Whether the cause changes an error neither by its interval nor by as much as is told, replayed or fitted."""
    of = [told for told in (told_first(gain, True), fitted(gain)) if {"before", "after"} <= told.keys()]
    return change(gain) == "unchanged" and all(abs(told["after"] - told["before"]) < WORSE_K for told in of)


def rise_K(gain: KeptGain, named: bool) -> float:
    """How much larger the error is at the last stage than as published [K], told first or fitted: where it is more."""
    of = list(told_first(gain, named))
    return max(told[of[-1]] - told[of[0]] for told in (told_first(gain, named), fitted(gain)))


def coefficients_suffice(gains: Sequence[KeptGain]) -> bool:
    """Whether recalibration lowers the error of the node that was furthest off and raises none."""
    return rise_K(furthest_first(gains)[0], False) < 0 and max(rise_K(gain, False) for gain in gains) < WORSE_K


def course(gain: KeptGain, named: bool, causes: int) -> str:
    """ "falls from 8.1 K as published to 1.4 K recalibrated and 0.9 K with the cause"; "to 0.7 K recalibrated, where
    the cause leaves it"; of several `causes` "with the causes"."""
    told = told_first(gain, named)
    if left := abs(_taken_K(gain, named)) < WORSE_K and "after" in told:
        del told["after"]
    errors_K = words.figures([*told.values()])
    first, *later = [f"{figure} K {STAGES[stage]}" for figure, stage in zip(errors_K, told, strict=True)]
    rose = list(told.values())[-1] - told["published"]
    verb = "rises" if rose >= WORSE_K else "falls" if rose <= -WORSE_K else "goes"
    leave = "the cause leaves" if causes < 2 else "the causes leave"
    ends = f", where {leave} it" * left + ", fitted" * (not replayed(gain))
    return f"{verb} from {first} to {words.joined(later)}{'s' * (causes > 1 and 'after' in told)}{ends}"


def _taken_K(gain: KeptGain, named: bool) -> float:
    """What the cause takes from the error that is told first [K]; 0 where there is none, or no file that says it."""
    told = told_first(gain, named)
    return told["before"] - told["after"] if {"before", "after"} <= told.keys() else 0.0


def _elsewhere(most: KeptGain, gains: Sequence[KeptGain], named: bool) -> str:
    """Where the cause takes most, if it takes nothing at the node `most`; "" where it takes nothing at all."""
    best = max(gains, key=lambda gain: _taken_K(gain, named))
    if _taken_K(most, named) >= WORSE_K or _taken_K(best, named) < WORSE_K:
        return ""
    told = told_first(best, named)
    before, after = words.figures([told["before"], told["after"]])
    return f"; the {words.name(best.node)}'s falls from {before} to {after} K with it"


def on_kept(diagnosis: Diagnosis) -> str:
    """What became of the node that was furthest off as published, where the cause gains if not there, and which got
    worse; "" without kept sessions."""
    gains, named = diagnosis.gain, diagnosis.learnt
    if not gains:
        return ""
    if calibration_is_worse(gains):
        worst = max(gains, key=lambda gain: gain.mae_before_K - gain.published_mae_K)
        at = f"{words.name(worst.node)} {errors(worst, stages(False), moved(worst))}"
        return f"recalibration makes the kept sessions worse: {at}; its files are not offered"
    most = furthest_first(gains)[0]
    told = f"on kept sessions the {words.name(most.node)}'s error {course(most, named, len(diagnosis.causes))}"
    told += _elsewhere(most, gains, named)
    worst = max(gains, key=lambda gain: rise_K(gain, named))
    if rise_K(worst, named) < WORSE_K:
        return told
    ends = list(told_first(worst, named))
    return f"{told}; worse: {words.name(worst.node)} {errors(worst, [ends[0], ends[-1]], moved(worst))}"


def beside(diagnosis: Diagnosis) -> str:
    """The sentence behind `on_kept`: what it left out of the node that it told, as far as there is such."""
    gains, named = diagnosis.gain, diagnosis.learnt
    if not gains:
        return ""
    most = furthest_first(gains)[0]
    if calibration_is_worse(gains):
        return f"With the cause: {words.name(most.node)} {errors(most, ['after'], moved(most))}." if named else ""
    if not replayed(most):
        return ""
    reading = f", its {moved(most)} by learnt corrections" if moved(most) else ""
    return f"With {FITTED}, the {words.name(most.node)}'s error is {chain(fitted(most), stages(named))}{reading}."
