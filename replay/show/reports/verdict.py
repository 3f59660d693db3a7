"""What a diagnosis says, in sentences: the same for terminal, report and viewer. Text only."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum, auto

from replay.show.words import words
from replay.studies.diagnosis.answer import Diagnosis, KeptGain, Named, Shown, UnnamedHeat
from twin.motor.causes import parse, says

UNITS: Mapping[str, str] = {"degC": "°C", "lpm": "l/min"}  # as stored -> as people write it
ON_THE_BENCH = ("sensor", "clock", "input", "boundary")  # kinds of cause that the bench file corrects
NO_SIZE = ("hold", "stuck", "saturation", "dropout", "undersampled")  # faults that are there or not
NUMBERS = ("No cause", "One cause", "Two causes", "Three causes", "Four causes", "Five causes")
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
    """Which of the four endings this is; a named cause goes before a heat that is left unknown."""
    if diagnosis.causes:
        return Ending.NAMED
    if diagnosis.unknown:
        return Ending.UNKNOWN
    tried = diagnosis.shown and diagnosis.candidates
    return Ending.AGREES if tried and not left_over(diagnosis) else Ending.CANNOT_TELL


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
    """Nodes that stay off by more than their floor, as "rotor 2.1 K": recalibrated on kept sessions, or as published
    where there are none and a further test is asked for."""
    errors = {error.node: error for error in node_errors(diagnosis.shown)}
    if diagnosis.gain:
        far = {node: FAR * error.floor_K for node, error in errors.items()}
        left = {g.node: g.mae_before_K for g in diagnosis.gain if g.mae_before_K > far.get(g.node, math.inf)}
    else:
        asked = diagnosis.next_test is not None
        left = {node: e.mean_K for node, e in errors.items() if asked and not e.within_floor}
    return [f"{words.name(node)} {words.kelvin(off)}" for node, off in left.items()]


def what_is_wrong(diagnosis: Diagnosis) -> str:
    """ "magnet 6.1 K mean, 17.0 K worst, most at 8,000 to 16,000 rpm · rotor surface 5.2 K · all else within its floor
    (0.4 K)"."""
    errors = node_errors(diagnosis.shown)
    wrong = [error for error in errors if not error.within_floor]
    fine = [error for error in errors if error.within_floor]
    if not errors:
        return "nothing can be said: no channel of these sessions observes a node of the model with usable samples"
    floor = words.kelvin(max((error.floor_K for error in fine), default=0.0))
    if not wrong:
        return f"nothing: every node is within its floor ({floor})"
    place = words.where(wrong[0].where)
    first = f"{words.name(wrong[0].node)} {words.kelvin(wrong[0].mean_K)} mean, {words.kelvin(wrong[0].max_K)} worst"
    first += f", most {place}" if place else ""
    others = [f"{words.name(error.node)} {words.kelvin(error.mean_K)}" for error in wrong[1:]]
    return " · ".join([first, *others, *([f"all else within its floor ({floor})"] if fine else [])])


def figures(value: float) -> str:
    """Three significant digits, thousands with a comma: "96", "1,240", "0.0312", "−1.4"."""
    text = f"{value:,.0f}" if abs(value) >= 100 else f"{value:.3g}"
    return text.replace("-", "−")


def signed(value: float) -> str:
    """`figures` with a plus where it is positive."""
    return f"{'+' if value > 0 else ''}{figures(value)}"


def unit(stored: str) -> str:
    """A stored unit as people write it."""
    return UNITS.get(stored, stored)


def size(cause: Named) -> str:
    """ "+96 W (88 to 104)", "+3.1 % (2.8 to 3.4)", "factor 1.35 (1.21 to 1.5)"; "" for a fault that is there or not."""
    law = parse(cause.id).law
    if law in NO_SIZE or law.startswith("swap_"):
        return ""
    if law == "scale":  # its size multiplies what was there
        return f"factor {figures(cause.estimate)} ({figures(cause.ci95[0])} to {figures(cause.ci95[1])})"
    scale, written = (100.0, "%") if cause.unit == "1" else (1.0, unit(cause.unit))
    low, high = (figures(scale * end) for end in cause.ci95)
    return f"{signed(scale * cause.estimate)} {written} ({low} to {high})"


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
    at = f"{session_name(diagnosis, cause.largest_effect_session)} {words.clock(cause.largest_effect_t_s)}"
    node = words.name(cause.largest_effect_node)
    return f"{how_much}{typical}largest effect {words.signed_kelvin(cause.largest_effect_K)} at the {node}, {at}"


def is_loss_at(cause: Named, node: str) -> bool:
    """Whether a cause, or one that it could not be told apart from, is a loss of this node, alone or in a group."""
    told = [parse(other) for other in (cause.id, *cause.indistinguishable_from)]
    at_node = any(other.kind == "loss" and other.place == node for other in told)
    return at_node or (told[0].kind == "loss" and node in cause.members)


def rivals_left(cause: Named) -> list[tuple[str, str]]:
    """(id, in words) of each cause that cannot be told apart from this one, best first."""
    return [(other, says(parse(other))) for other in cause.indistinguishable_from]


def whether_improved(cause: Named) -> str:
    """What became of a named cause."""
    if cause.improved:
        return f"corrected in the {'bench' if parse(cause.id).kind in ON_THE_BENCH else 'motor'} file"
    why = cause.why_not_improved or "the kept sessions are not predicted better with it"
    return f"named, but no file is changed for it: {why}"


def watts(heat: UnnamedHeat) -> str:
    """ "adds 20 to 45 W at endwinding b", "takes 20 to 45 W away from endwinding b"."""
    low, high = sorted(heat.watts)
    node = words.name(heat.node)
    if low >= 0:
        return f"adds {figures(low)} to {figures(high)} W at {node}"
    if high <= 0:
        return f"takes {figures(-high)} to {figures(-low)} W away from {node}"
    return f"takes up to {figures(-low)} W from and adds up to {figures(high)} W to {node}"


def active(heat: UnnamedHeat) -> str:
    """ "when it is 90 to 140 °C and speed is 3,000 to 6,000 rpm"; "" where it goes with no range."""
    parts = []
    for key, (low, high) in heat.when.items():
        name, _, stored = key.rpartition("_")
        span = f"{words.number(words.rounded(low))} to {words.number(words.rounded(high))}"
        subject = "it" if name == heat.node else words.name(name)
        parts.append(f"{subject} is {span} {unit(stored)}")
    return f"when {words.joined(parts)}" if parts else ""


def unknown_sentence(heat: UnnamedHeat) -> str:
    """Where, how many watts, when; no candidate explains it. Of patchwork, what fits only together."""
    if heat.patchwork:
        together = f"{words.joined(heat.patchwork)} fit only together, so none of them is named"
        return f"Something at {words.name(heat.node)} has a form that no candidate has: {together}."
    return f"Something {' '.join(filter(None, [watts(heat), active(heat)]))}; no candidate explains it."


def change(gain: KeptGain) -> str:
    """ "better", "worse" or "unchanged": what the whole interval of the difference says."""
    low, high = sorted(gain.ci95_K)
    if low > 0:
        return "better"
    return "worse" if high < 0 else "unchanged"


def gained(diagnosis: Diagnosis) -> str:
    """ "from 6.1 K to 0.9 K at the magnet and from 5.2 K to 0.8 K at the rotor": nodes that are better, most first."""
    better = [gain for gain in diagnosis.gain if change(gain) == "better"]
    told = sorted(better, key=lambda gain: gain.mae_after_K - gain.mae_before_K)[:3]
    falls = [(words.kelvin(g.mae_before_K), words.kelvin(g.mae_after_K), words.name(g.node)) for g in told]
    return words.joined([f"from {before} to {after} at the {node}" for before, after, node in falls])


def answer(diagnosis: Diagnosis) -> str:
    """One to three sentences that answer why the motor is hotter than the model says, or the test that would."""
    open_ended = ending(diagnosis) in (Ending.UNKNOWN, Ending.CANNOT_TELL)
    if not open_ended or diagnosis.next_test is None:
        return finding(diagnosis)
    return f"{finding(diagnosis)} Most telling next test: {diagnosis.next_test.rstrip('.')}."


def finding(diagnosis: Diagnosis) -> str:
    """What was found, in sentences."""
    match ending(diagnosis):
        case Ending.NAMED:
            parts = [_named(diagnosis), _on_kept(diagnosis)]
            parts += [f"Beside that: s{unknown_sentence(heat)[1:]}" for heat in diagnosis.unknown[:1]]
            return " ".join(filter(None, parts))
        case Ending.UNKNOWN:
            return " ".join(unknown_sentence(heat) for heat in diagnosis.unknown)
        case Ending.AGREES:
            return _agrees(diagnosis)
        case Ending.CANNOT_TELL:
            return _cannot_tell(diagnosis)


def _named(diagnosis: Diagnosis) -> str:
    if len(diagnosis.causes) == 1:
        cause = diagnosis.causes[0]
        told = [cause.says, *(says_so for _, says_so in rivals_left(cause))]
        if len(told) > 1:
            return f"One of {len(told)} causes that these sessions cannot tell apart: {'; '.join(told)}."
        return f"{words.capital(_with_size(cause))}, probability {probability(cause.probability)}."
    many = len(diagnosis.causes)
    count = NUMBERS[many] if many < len(NUMBERS) else f"{many} causes"
    return f"{count}: {'; '.join(_with_size(cause) for cause in diagnosis.causes)}."


def _with_size(cause: Named) -> str:
    others = len(cause.indistinguishable_from)
    apart = f", not told apart from {words.counted(others, 'other')}" if others else ""
    return f"{cause.says}{', ' + size(cause) if size(cause) else ''}{apart}"


def _on_kept(diagnosis: Diagnosis) -> str:
    improved = [cause for cause in diagnosis.causes if cause.improved]
    if not improved:
        if not diagnosis.held_out:
            return "No session was kept to measure the gain on, so no file is changed."
        return "The kept sessions are not predicted better with it, so no file is changed."
    better = gained(diagnosis)
    return f"On kept sessions the mean error falls {better}." if better else ""


def _agrees(diagnosis: Diagnosis) -> str:
    wrong = [error for error in node_errors(diagnosis.shown) if not error.within_floor]
    tried = f"{diagnosis.candidates:,} candidates tried, {_best(diagnosis)}"
    if not wrong:
        return f"The twin agrees with these sessions within its floor; {tried}."
    if not diagnosis.gain:
        return f"No cause beyond the model's own coefficients has evidence; {tried}."
    off = f"{words.kelvin(wrong[0].mean_K)} off at the {words.name(wrong[0].node)}"
    return (
        f"No new cause is needed: the model as published is {off}, and its own coefficients, moved within what the "
        f"motor file allows, take that away; {tried}."
    )


def against(diagnosis: Diagnosis) -> str:
    """ "null 3.2, threshold 6.4": what evidence is compared with."""
    return f"null {figures(diagnosis.null_log_bayes_factor)}, threshold {figures(diagnosis.threshold)}"


def _best(diagnosis: Diagnosis) -> str:
    best = max(diagnosis.rivals, key=lambda rival: rival.log_bayes_factor, default=None)
    if best is None:
        return f"none with evidence ({against(diagnosis)})"
    found = f"best ln BF {figures(best.log_bayes_factor)} ({against(diagnosis)})"
    if best.log_bayes_factor <= diagnosis.threshold:
        return found
    return f"{found}: {best.id}, which is no cause all the same: see the rivals"


def _cannot_tell(diagnosis: Diagnosis) -> str:
    if not diagnosis.shown:
        return "Nothing can be said: no channel of these sessions observes a node of the model with usable samples."
    if not diagnosis.candidates:
        return "Nothing can be said: these sessions leave no candidate that could be tried."
    off = f"{words.joined(left_over(diagnosis))} stay above the sensors' floor"
    fits = [rival.id for rival in diagnosis.rivals if rival.log_bayes_factor > diagnosis.threshold]
    why = f"of {diagnosis.candidates:,} candidates none stands out: {_best(diagnosis)}."
    if fits:
        best = words.joined(fits[:2])
        why = f"what would explain the sessions learnt from ({best}) is no cause: see the rivals."
    return f"These sessions cannot tell why: {off}, and {why}"
