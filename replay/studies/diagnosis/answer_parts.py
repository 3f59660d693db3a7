"""The parts of a diagnosis' answer, worded from what the twin found."""

from __future__ import annotations

from collections.abc import Sequence
from typing import assert_never

import numpy as np

from ingest.facts.events import SessionRecorded
from ingest.texts.quantities import column_suffix
from replay.engine.results.residuals import where
from replay.studies.diagnosis.answer import EvidenceParts, HeatOverLoad, Named, Rival, Shown, Stands, UnnamedHeat
from replay.studies.diagnosis.formulas import formula
from replay.studies.diagnosis.kept_sessions import Measured
from twin.calibration.learned import Size, size, term_of
from twin.diagnosis.free_heats import Unknown
from twin.diagnosis.free_maps import LossMap
from twin.diagnosis.in_words import Plain
from twin.diagnosis.naming import ENOUGH_SESSIONS, MOST_TERMS, Naming
from twin.diagnosis.rounds import EVIDENT, Against, Refit, Round
from twin.diagnosis.told_apart import ToldApart, separating_test, telling_test, told_apart
from twin.differences.candidates import Candidate
from twin.differences.proposals import at_one
from twin.fitting.actions import Added, PartOfHeat
from twin.fitting.fit import Fit
from twin.fitting.model import Floats, Model
from twin.fitting.noise import floor_variance
from twin.motor.causes import says
from twin.motor.features import quantity, scale
from twin.motor.network import Network
from twin.motor.sensor_laws import Misreading

RIVALS = 5
NOBODY_KEPT = "no session was kept: say --hold-out"
NO_TORQUE = "a motor that brakes needs a map over the torque, and these sessions have none, or its motor file no scale"
OF_FORM = "it moves no reading by more than a model of lumps is off by anyway"
ONE_ALONE = f"with fewer than {ENOUGH_SESSIONS} sessions none can be left out to say whether a second term holds"
OTHER_CAUSES, WORTH_TELLING = "other causes", 0.1  # families that are relieved by less, in ln, are not told


def shown(model: Model, sessions: Sequence[SessionRecorded]) -> list[Shown]:
    """What the file's own model gets wrong on the training sessions."""
    result = []
    for series in model.residuals(np.zeros(len(model.parameters))):
        test, session = model.tests[series.session], sessions[series.session]
        channel = next((c for c in test.channels if c.name == series.channel), None)
        if channel is None:  # a meter, whose rows are no temperatures
            continue
        at = np.minimum((series.t_s / test.frame.step_s).astype(np.intp), len(test.frame.features) - 1)
        size_K = np.abs(series.y)
        places = {with_unit(f): values[at] * scale(model.network, f) for f, values in test.inputs.items()}
        floor = float(np.hypot(np.sqrt(floor_variance(series, model.noise_of(series.channel))), channel.sensor.bias_sd))
        result.append(
            Shown(
                session=session.session,
                session_name=session.name,
                channel=series.channel,
                node=channel.sensor.followed or " + ".join(channel.sensor.weights),
                mae_K=float(size_K.mean()),
                max_K=float(size_K.max()),
                bias_K=float(series.y.mean()),
                floor_K=floor,
                white=_white(series.y),
                where={name: span for name, value in places.items() if (span := where(value, size_K)) is not None},
            )
        )
    return result


def with_unit(feature: str) -> str:
    """`speed` -> `speed_rpm`."""
    return feature + column_suffix(quantity(feature) or feature)


def _white(residual: Floats) -> bool:
    """Whether neighbouring blocks say nothing of each other: lag-1 autocorrelation within two sigma (Bartlett)."""
    centred = residual - residual.mean()
    total = float(centred @ centred)
    return bool(total == 0.0 or abs(float(centred[1:] @ centred[:-1])) / total < 2 / np.sqrt(len(residual)))


def named(naming: Naming, refit: Refit, train: Sequence[SessionRecorded], kept: Measured | None) -> Named:
    """A cause that survived the search over the sessions `train`, with its size, class and gain."""
    final, cause = naming.final, refit.candidate.cause
    place = place_of(final, refit)
    found = size(final, place, refit.candidate.unit)
    effect_K, node, test, t_s = _largest_effect(final, place)
    first = naming.entered(refit.candidate)
    apart = class_of(naming, refit, kept)
    let_in = [one.candidate for one in naming.accepted]
    others = [member.candidate for member in apart.others if member.candidate not in let_in]
    improved = kept is not None and kept.improved and refit.candidate.sayable
    why = kept.why if kept else NOBODY_KEPT
    if not refit.candidate.sayable:
        why = "what changes from session to session is said by no file"
    return Named(
        id=str(cause),
        says=says(cause),
        members=list(refit.candidate.members),
        estimate=found.value,
        ci95=sorted([found.low, found.high]),
        unit=found.unit,
        typical_W=found.typical_W,
        largest_effect_K=effect_K,
        largest_effect_node=node,
        largest_effect_session=train[test].session,
        largest_effect_t_s=t_s,
        formula=_formula(refit, found, final.model.network),
        log_bayes_factor=refit.log_bayes_factor,
        probability=apart.probability,
        member_probability=apart.leader.probability,
        indistinguishable_from=[str(other.cause) for other in others],
        separating_test=separating_test(first, refit.candidate, others[0]) if others else None,
        significant=True,
        identified=all((o.cause.kind, o.cause.place) == (cause.kind, cause.place) for o in others),
        improved=improved,
        why_not_improved=None if improved else why,
        times_usual=abs(refit.amplitude) / refit.parameter.sd,
        sayable=refit.candidate.sayable,
        evidence=evidence_parts(naming, refit),
        stands=_stands(refit),
    )


def class_of(naming: Naming, refit: Refit, kept: Measured | None) -> ToldApart:
    """A named term with what the data cannot tell from it, by the round in which it entered. Sessions that were kept
    and get better with what is named say that it is more than what a crude file lacks."""
    listed = 1.0 if _is_confirmed(kept) else naming.listed
    return told_apart(naming.entered(refit.candidate), refit.candidate, naming.log_bf_instead, listed)


def doubtful(naming: Naming, kept: Measured | None) -> float | None:
    """How crude the file is, where something stands out that may be what it lacks; None elsewhere."""
    stands_out = naming.accepted or naming.is_unknown
    return naming.crudeness if stands_out and not _is_confirmed(kept) and naming.listed < 1.0 else None


def _is_confirmed(kept: Measured | None) -> bool:
    return kept is not None and kept.improved


def evidence_parts(naming: Naming, refit: Refit) -> EvidenceParts:
    """Where the ln BF of a refitted candidate comes from, families by their names."""
    stated = len(naming.rounds[0].base.model.parameters)
    others = [one for one in refit.fit.model.parameters if one != refit.parameter]
    plain, split = Plain(refit.fit.model.network), refit.evidence
    relieved = dict.fromkeys([*map(plain.group, others[:stated]), OTHER_CAUSES], 0.0)
    for i, (one, value) in enumerate(zip(others, split.relieved.tolist(), strict=True)):
        name = plain.group(one) if i < stated or isinstance(one.action, PartOfHeat) else OTHER_CAUSES
        relieved[name] = relieved.get(name, 0.0) + value
    told = sorted(relieved.items(), key=lambda one: -one[1])
    return EvidenceParts(
        fit=split.fit,
        priors_relieved=split.priors_relieved,
        rest=split.rest,
        relieved={name: value for name, value in told if abs(value) >= WORTH_TELLING},
    )


def _stands(refit: Refit) -> Stands:
    """The size of a term in the readings: what these tell of it is its posterior precision less that of its prior."""
    information = max(0.0, refit.sd**-2 - refit.parameter.sd**-2)
    return Stands(
        amplitude=refit.amplitude / at_one(refit.parameter), d=abs(refit.amplitude) * float(np.sqrt(information))
    )


def place_of(final: Fit, refit: Refit) -> int:
    """Where a term stands in the vector of the final fit."""
    return next(i for i, p in enumerate(final.model.parameters) if p == refit.parameter)


def _largest_effect(final: Fit, place: int) -> tuple[float, str, int, float]:
    """What a term moves at most: K, the node, the test and the time [s]."""
    without = final.beta.copy()
    without[place] = 0.0
    best = (0.0, final.model.network.nodes[0].name, 0, 0.0)
    for s, test in enumerate(final.model.tests):
        moved = final.model.course(s, final.beta)[1] - final.model.course(s, without)[1]
        k, node = (int(i) for i in np.unravel_index(np.argmax(np.abs(moved)), moved.shape))
        if abs(moved[k, node]) > best[0]:
            name = final.model.network.nodes[node].name
            best = (float(abs(moved[k, node])), name, s, (k + 0.5) * test.frame.step_s)
    return best


def _formula(refit: Refit, found: Size, network: Network) -> str:
    cause, action, added = refit.candidate.cause, refit.candidate.action, refit.candidate.added
    if isinstance(action, Added) and added is not None:
        return formula(term_of(action, found.value, added.exponents), cause.place, network)
    if cause.law == "scale":
        return f"{cause.kind} of {cause.place} times {found.value:.3g}"
    unit = "" if found.unit == "1" else f" {found.unit}"
    return f"{cause} = {found.value:.4g}{unit}"


def rivals(naming: Naming, refused: Sequence[tuple[Refit, str]]) -> list[Rival]:
    """The best candidates that were not named, and why. `refused`: terms that the kept sessions spoke against, with the
    reason."""
    chosen = {str(refit.candidate.cause) for refit in naming.accepted}
    found: dict[str, Rival] = {}

    def add(candidate: Candidate, value: float, why: str, refit: Refit | None = None) -> None:
        name = str(candidate.cause)
        if name not in chosen and name not in found:
            found[name] = Rival(
                id=name,
                says=says(candidate.cause),
                log_bayes_factor=value,
                why_not=why,
                evidence=evidence_parts(naming, refit) if refit else None,
                stands=_stands(refit) if refit else None,
            )

    for refit, reason in refused:
        add(refit.candidate, refit.log_bayes_factor, reason, refit)
    for refit in naming.patchwork:
        others = " and ".join(str(r.candidate.cause) for r in naming.patchwork if r is not refit)
        why = f"fits only together with {others}: none of them has the form of what is there"
        add(refit.candidate, refit.log_bayes_factor, why, refit)
    for candidate, value in naming.left_out:
        add(candidate, value, "let in first; left out at the end, the fit is about as good")
    first = naming.rounds[0]
    for i in first.order():
        if first.of_form[i] and first.scores.log_bayes_factor[i] > naming.threshold:
            add(first.candidates[i], float(first.scores.log_bayes_factor[i]), OF_FORM)
    for one in naming.rounds:
        for refit in sorted(one.refits, key=lambda r: -r.log_bayes_factor):
            add(refit.candidate, refit.log_bayes_factor, _why_not(naming, one, refit), refit)
    return list(found.values())[:RIVALS]


def _why_not(naming: Naming, one: Round, refit: Refit) -> str:
    """Why a candidate that was refitted in a round was not let in."""
    best, last = one.best, one is naming.rounds[-1]
    ahead = best.log_bayes_factor if best else 0.0
    if not refit.ended:
        return f"its refit was stopped early: it would have stayed about {ahead - refit.promised:.1f} behind in ln BF"
    if not refit.possible:
        return "it would have to take away more than there is"
    if refit.of_form:
        return OF_FORM
    if refit.left_out is not None:
        return _said_by_sessions(one, refit)
    if last and refit.log_bayes_factor > naming.threshold:
        return ONE_ALONE if naming.few_sessions else f"{MOST_TERMS} terms are the most that are named"
    if last:
        return f"under the threshold of {naming.threshold:.0f}"
    return f"{ahead - refit.log_bayes_factor:.1f} behind in ln BF after both were refitted"


def _said_by_sessions(one: Round, refit: Refit) -> str:
    """Why sessions left out did not let a candidate in."""
    assert one.left_out is not None, "sessions left out judged it"
    match one.against(refit):
        case Against.NO_NEARER:
            errors = f"{one.left_out.mean_K():.2f} -> {refit.left_out_K:.2f} K"
            ruler = ", against readings as recorded" * isinstance(refit.parameter.action, Misreading)
            return f"sessions left out are not clearly nearer with it ({errors}{ruler})"
        case Against.TOO_LITTLE:
            said = float(one.gained(refit).sum())
            return f"sessions left out ask for it by {said:.1f} in ln density, and {EVIDENT:.0f} is needed"
        case None:
            assert one.best is not None, "this one holds"
            errors = f"{one.best.left_out_K:.2f} K, with this one {refit.left_out_K:.2f} K"
            return f"sessions left out are nearer with the term that was let in instead ({errors})"
        case other:
            assert_never(other)


def judged_by(naming: Naming) -> str:
    """What let terms in, as the answer says it."""
    return "few sessions" if naming.few_sessions else "sessions left out" if naming.judged else "evidence"


def suspected_test(naming: Naming) -> str | None:
    """The test after which the best candidate that nothing was named for would stand out, if it is there; None without
    one, or where something was learnt in its place."""
    best = naming.rounds[0].best
    test = telling_test(naming.rounds[0], best.candidate) if best and not naming.learnt else None
    return f"{test}: it would show whether {best.candidate.cause} is there" if best and test else None


def unknown_heat(heat: Unknown, naming: Naming, kept: Measured | None) -> UnnamedHeat:
    """A free heat in stored units. `kept`: what the kept sessions say of `naming.final`."""
    network, patchwork = naming.final.model.network, naming.patchwork
    fitted = heat.map is not None and naming.heat is not None
    extends = naming.map_said if fitted else None
    improved = fitted and kept is not None and kept.improved and extends is not None
    why = (kept.why if kept else NOBODY_KEPT) if extends else NO_TORQUE
    when = {with_unit(f): [low * scale(network, f), high * scale(network, f)] for f, (low, high) in heat.inputs.items()}
    when[f"{heat.node}_degC"] = list(heat.temperature_degC)
    return UnnamedHeat(
        node=heat.node,
        watts=list(heat.watts),
        when=when,
        goes_with=list(heat.goes_with),
        log_bayes_factor=heat.log_bayes_factor,
        patchwork=[str(refit.candidate.cause) for refit in patchwork],
        map=_over_load(heat.map, network) if heat.map else None,
        fitted=fitted,
        extends=extends,
        improved=improved,
        why_not_improved=why if fitted and not improved else None,
    )


def _over_load(found: LossMap, network: Network) -> HeatOverLoad:
    """A map in stored units."""
    loads = [float(load) * scale(network, found.load) for load in found.loads]
    return HeatOverLoad(
        speed_rpm=[float(speed) * scale(network, "speed") for speed in found.speeds],
        torque_Nm=loads if found.load == "torque" else [],
        current_A=loads if found.load == "current" else [],
        watts=found.watts.tolist(),
        seconds=found.seconds.tolist(),
    )
