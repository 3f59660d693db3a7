"""What a diagnosis says, piece by piece: the same for terminal, report and viewer. Text only."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum, auto

from ingest.texts.times import clock
from ingest.texts.units import as_written
from replay.show.reports import kept_errors
from replay.show.words import words
from replay.studies.diagnosis.answer import Diagnosis, EvidenceParts, Named, Rival, Shown, UnnamedHeat
from twin.motor.causes import parse, says

ON_THE_BENCH = ("sensor", "clock", "input", "boundary")  # kinds of cause that the bench file corrects
NO_SIZE = ("hold", "stuck", "saturation", "dropout", "undersampled")  # faults that are there or not
UNUSUAL = 4.0  # prior sd of a cause: one that is larger says so
LEAST_SHARE = 0.5  # of ln BF: a family that is relieved by less is not told
WAYS = {"braking": "while the motor brakes", "driving": "while the motor drives"}  # what a heat may go with
OWN = "within the sensors' own uncertainty"
FAR = 2.0  # floors: a recalibrated model that stays further off on kept sessions lacks something


class Ending(Enum):
    """How a diagnosis ends."""

    NAMED = auto()  # a cause entered by evidence and survived being left out
    UNKNOWN = auto()  # a heat that no candidate explains
    AGREES = auto()  # nothing beyond the coefficients is needed
    CANNOT_TELL = auto()  # errors are left, and these sessions single no candidate out


@dataclass(frozen=True)
class NodeError:
    """What the model as published gets wrong at one node over the sessions shown [K]: `mean_K` over its channels and
    sessions, the worst channel's `max_K` and `where` it is worst."""

    node: str
    mean_K: float
    max_K: float
    floor_K: float
    where: Mapping[str, Sequence[float]]

    @property
    def within_floor(self) -> bool:
        """The mean error is not larger than the sensors' own uncertainty."""
        return self.mean_K <= self.floor_K


def ending(diagnosis: Diagnosis) -> Ending:
    """Which of the four endings this is; a named cause goes before a heat that is left unknown, and that before faults
    of the record, which were left out and explain nothing of what the model gets wrong. Where that is nothing, a heat
    needs the evidence of a cause."""
    if diagnosis.fitted_with:
        return Ending.NAMED
    if any(not within_floor(diagnosis) or heat.log_bayes_factor > diagnosis.threshold for heat in diagnosis.unknown):
        return Ending.UNKNOWN
    if diagnosis.causes:
        return Ending.NAMED
    tried = diagnosis.shown and diagnosis.candidates
    return Ending.AGREES if tried and not left_over(diagnosis) else Ending.CANNOT_TELL


def within_floor(diagnosis: Diagnosis) -> bool:
    """Whether there are errors as published, and none is above its sensors' own uncertainty."""
    return bool(diagnosis.shown) and all(error.within_floor for error in node_errors(diagnosis.shown))


def node_errors(shown: Sequence[Shown]) -> list[NodeError]:
    """Nodes, furthest off first."""
    errors = []
    for node in dict.fromkeys(entry.node for entry in shown):
        mine = [entry for entry in shown if entry.node == node]
        worst = max(mine, key=lambda entry: entry.max_K)
        mean = sum(entry.mae_K for entry in mine) / len(mine)
        errors.append(NodeError(node, mean, worst.max_K, max(entry.floor_K for entry in mine), worst.where))
    return sorted(errors, key=lambda error: -error.mean_K)


def left_over(diagnosis: Diagnosis) -> list[str]:
    """Nodes that stay off by more than their floor, as "rotor 2.4 K (fitted 2.1 K)": recalibrated on kept sessions, or
    as published where there are none and a further test is asked for."""
    errors = {error.node: error for error in node_errors(diagnosis.shown)}
    if diagnosis.gain:
        far = {node: FAR * error.floor_K for node, error in errors.items()}
        left = [g for g in diagnosis.gain if g.mae_before_K > far.get(g.node, math.inf)]
        return [f"{words.name(g.node)} {kept_errors.errors(g, ['before'], kept_errors.moved(g))}" for g in left]
    asked = diagnosis.next_test is not None
    wrong = [error for error in errors.values() if asked and not error.within_floor]
    return [f"{words.name(error.node)} {words.kelvin(error.mean_K)}" for error in wrong]


def what_is_wrong(diagnosis: Diagnosis) -> str:
    """ "magnet 6.1 K off in the mean of the 3 sessions learnt from, 17.0 K at worst, most at 8,000 to 16,000 rpm ·
    rotor surface 5.2 K · all else within the sensors' own uncertainty (0.4 K)"."""
    errors = node_errors(diagnosis.shown)
    wrong = [error for error in errors if not error.within_floor]
    fine = [error for error in errors if error.within_floor]
    if not errors:
        return "nothing can be said: no channel of these sessions observes a node of the model with usable samples"
    floor = words.kelvin(max((error.floor_K for error in fine), default=0.0))
    if not wrong:
        return f"nothing: every node is {OWN} ({floor})"
    place = words.where(wrong[0].where)
    mean, worst = words.kelvin(wrong[0].mean_K), words.kelvin(wrong[0].max_K)
    first = f"{words.name(wrong[0].node)} {mean} off in the mean of {_learnt_from(diagnosis)}, {worst} at worst"
    first += f", most {place}" if place else ""
    others = [f"{words.name(error.node)} {words.kelvin(error.mean_K)}" for error in wrong[1:]]
    return " · ".join([first, *others, *([f"all else {OWN} ({floor})"] if fine else [])])


def _learnt_from(diagnosis: Diagnosis) -> str:
    """ "the 3 sessions learnt from"."""
    count = len({entry.session for entry in diagnosis.shown})
    return "the session learnt from" if count == 1 else f"the {count} sessions learnt from"


def signed(value: float) -> str:
    """Three digits with a plus where it is positive."""
    return f"{'+' if value > 0 else ''}{words.digits(value)}"


def is_exchange(cause: Named) -> bool:
    """Whether it is that two channels are exchanged."""
    return parse(cause.id).law.startswith("swap_")


def size(cause: Named) -> str:
    """ "+96 W (88 to 104)", "+3.1 % (2.8 to 3.4)", "factor 1.35 (1.21 to 1.50)"; "" for what is there or not."""
    law = parse(cause.id).law
    if law in NO_SIZE or is_exchange(cause):
        return ""
    if law == "scale":  # its size multiplies what was there
        estimate, *ends = in_digits(cause.estimate, cause.ci95)
        return f"factor {estimate} ({' to '.join(ends)})"
    return amount(cause.estimate, cause.ci95, cause.unit)


def amount(estimate: float, ci95: Sequence[float], stored: str) -> str:
    """ "+96 W (88 to 104)", "+3.1 % (2.8 to 3.4)" of a share, in the unit "1"."""
    scale, written = (100.0, "%") if stored == "1" else (1.0, as_written(stored))
    told, *ends = in_digits(scale * estimate, [scale * end for end in ci95])
    sign = "+" * (estimate > 0)
    return f"{' '.join(filter(None, [sign + told, written]))} ({' to '.join(ends)})"


def in_digits(estimate: float, ci95: Sequence[float]) -> list[str]:
    """An estimate and the ends of its interval with as many decimals as the interval leaves it: steps of a twentieth to
    half of its half width; three significant digits where it has none."""
    half = abs(ci95[1] - ci95[0]) / 2
    if not 0.0 < half < math.inf:
        return [words.digits(value) for value in (estimate, *ci95)]
    decimals = max(0, math.ceil(-math.log10(half / 2)))
    return [f"{value:,.{decimals}f}".replace("-", "−") for value in (estimate, *ci95)]


def probability(value: float) -> str:
    """ "97 %"; what rounds to all or nothing is not called so."""
    if value > 0.995:
        return "over 99 %"
    return "under 1 %" if value < 0.005 else f"{100 * value:.0f} %"


def session_name(diagnosis: Diagnosis, session: str) -> str:
    """The name of a session of the diagnosis, by its id."""
    ids, names = [*diagnosis.train, *diagnosis.held_out], [*diagnosis.train_names, *diagnosis.held_out_names]
    return dict(zip(ids, names, strict=True)).get(session, session)


def effect(diagnosis: Diagnosis, cause: Named) -> str:
    """How much, and where it shows most, in words."""
    typical = f"{signed(cause.typical_W)} W at the typical point; " if cause.typical_W is not None else ""
    how_much = f"{size(cause)}; " if size(cause) else ""
    if not cause.largest_effect_session:
        return f"{how_much}a fault of the record: no term of the model"
    at = f"{session_name(diagnosis, cause.largest_effect_session)} {clock(cause.largest_effect_t_s)}"
    node = words.name(cause.largest_effect_node)
    more = f"; {cause.times_usual:.0f} times as large as such a cause usually is" * (cause.times_usual > UNUSUAL)
    if cause.largest_effect_K == 0.0:
        return f"{how_much}{typical}it moves a reading and no temperature of the motor{more}"
    return f"{how_much}{typical}largest effect {words.signed_kelvin(cause.largest_effect_K)} at the {node}, {at}{more}"


def is_loss_at(cause: Named, node: str) -> bool:
    """Whether a cause, or one that it could not be told apart from, is a loss of this node, alone or in a group."""
    told = [parse(other) for other in (cause.id, *cause.indistinguishable_from)]
    at_node = any(other.kind == "loss" and other.place == node for other in told)
    return at_node or (told[0].kind == "loss" and node in cause.members)


def alone(cause: Named) -> str:
    """That nothing looks like a cause; "" where something does."""
    told = "nothing: every other candidate is more than 3 behind in ln BF (20 times less probable)"
    return "" if cause.indistinguishable_from else told


def rivals_left(cause: Named) -> list[tuple[str, str]]:
    """(id, in words) of each cause that cannot be told apart from this one, best first."""
    return [(other, says(parse(other))) for other in cause.indistinguishable_from]


def rivals(diagnosis: Diagnosis) -> list[Rival]:
    """The candidates that were not named, strongest first."""
    return sorted(diagnosis.rivals, key=lambda rival: -rival.log_bayes_factor)


def whether_improved(diagnosis: Diagnosis, cause: Named) -> str:
    """What became of a named cause."""
    file = "bench" if parse(cause.id).kind in ON_THE_BENCH else "motor"
    if cause.improved and not diagnosis.why_no_files:
        return f"corrected in the {file} file"
    return _not_improved(diagnosis, cause, file if cause.sayable else None)


def what_the_file_says(diagnosis: Diagnosis, heat: UnnamedHeat) -> str:
    """What became of a heat without a name that the sessions were fitted with once more; "" of any other."""
    if not heat.fitted:
        return ""
    if heat.improved and not diagnosis.why_no_files:
        return "in the extended motor file, as a map over speed and load"
    return _not_improved(diagnosis, heat, "motor" if heat.extends else None)


def _not_improved(diagnosis: Diagnosis, one: Named | UnnamedHeat, file: str | None) -> str:
    """Why nothing improved with something that was learnt; `file`: which one can say it, None: none."""
    why = one.why_not_improved or diagnosis.why_no_files or "the kept sessions are not predicted better with it"
    if file and diagnosis.offers:
        return f"in the extended {file} file, which is offered though not improved: {why}"
    return f"{'named, but no' if isinstance(one, Named) else 'no'} file is changed for it: {why}"


def watts(heat: UnnamedHeat) -> str:
    """ "adds 20 to 45 W at endwinding b", "takes 20 to 45 W away from endwinding b"."""
    low, high = sorted(heat.watts)
    node = words.name(heat.node)
    if low >= 0:
        return f"adds {words.digits(low)} to {words.digits(high)} W at {node}"
    if high <= 0:
        return f"takes {words.digits(-high)} to {words.digits(-low)} W away from {node}"
    return f"takes up to {words.digits(-low)} W from and adds up to {words.digits(high)} W to {node}"


def goes_with(heat: UnnamedHeat) -> str:
    """ "It goes with endwinding b and current. ", strongest first; "" where `active` says all."""
    names = [words.name(name) for name in heat.goes_with if name not in WAYS]
    return f"It goes with {words.joined(names)}. " if names else ""


def active(heat: UnnamedHeat) -> str:
    """ "while the motor brakes, when it is 90 to 140 °C and speed is 3,000 to 6,000 rpm"; "" where it goes with no
    range."""
    way = next((WAYS[name] for name in heat.goes_with if name in WAYS), "")
    parts = []
    for key, (low, high) in heat.when.items():
        name, _, stored = key.rpartition("_")
        ends = [words.number(words.rounded(end)) for end in (low, high)]
        span = f"about {ends[0]}" if ends[0] == ends[1] else " to ".join(ends)
        subject = "it" if name == heat.node else words.name(name)
        parts.append(f"{subject} is {span} {as_written(stored)}")
    return ", ".join(filter(None, [way, f"when {words.joined(parts)}" if parts else ""]))


def unknown_sentence(heat: UnnamedHeat) -> str:
    """Where, how many watts, when; no candidate explains it. Of patchwork, what fits only together."""
    return f"{something(heat)}{': ' if heat.patchwork else '; '}{unexplained(heat)}"


def something(heat: UnnamedHeat) -> str:
    """Where, how many watts, when, without names of code."""
    if heat.patchwork:
        return f"Something at {words.name(heat.node)} has a form that no candidate has"
    return f"Something {' '.join(filter(None, [watts(heat), active(heat)]))}"


def unexplained(heat: UnnamedHeat) -> str:
    """That no candidate explains it; of patchwork, what fits only together."""
    if heat.patchwork:
        return f"{words.joined(heat.patchwork)} fit only together, so none of them is named."
    return "no candidate explains it."


def comes_from(evidence: EvidenceParts) -> str:
    """ "1.9 fit (readings are met more closely), 17.2 priors relieved (other numbers move less, mostly form of the
    losses in iron: 12.1), −2.5 rest"."""
    most, value = max(evidence.relieved.items(), key=lambda one: one[1], default=("", 0.0))
    family = f", mostly {most}: {_tenths(value)}" if value >= LEAST_SHARE else ""
    closely = "more" if evidence.fit >= 0 else "less"
    move = f"less{family}" if evidence.priors_relieved >= 0 else "further"
    return (
        f"{_tenths(evidence.fit)} fit (readings are met {closely} closely), {_tenths(evidence.priors_relieved)} priors "
        f"relieved (other numbers move {move}), {_tenths(evidence.rest)} rest"
    )


def fit_and_priors(evidence: EvidenceParts) -> str:
    """ "1.9 fit, 17.2 priors relieved"."""
    return f"{_tenths(evidence.fit)} fit, {_tenths(evidence.priors_relieved)} priors relieved"


def _tenths(value: float) -> str:
    return f"{value:.1f}".replace("-", "−")


def against(diagnosis: Diagnosis) -> str:
    """ "null 3.2, threshold 6.4": what evidence is compared with."""
    return f"null {words.digits(diagnosis.null_log_bayes_factor)}, threshold {words.digits(diagnosis.threshold)}"
