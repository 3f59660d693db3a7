"""The answer of a diagnosis in sentences: the same for terminal, report and viewer. Text only."""

from __future__ import annotations

from replay.show.reports import beyond_usual, doubts, kept_errors, two_models, verdict
from replay.show.reports.verdict import Ending, against, ending
from replay.show.words import words
from replay.studies.diagnosis.answer import Diagnosis, Named

LONGEST = 45  # words of a first sentence: what is as long becomes two


def answer(diagnosis: Diagnosis) -> str:
    """A few sentences that answer why the motor is hotter than the model says, or the test that would."""
    beside = [no_files(diagnosis), *doubts.told(diagnosis)]
    told = " ".join(filter(None, [headline(diagnosis), details(diagnosis), *beside]))
    open_ended = ending(diagnosis) in (Ending.UNKNOWN, Ending.CANNOT_TELL)
    if not open_ended or diagnosis.next_test is None:
        return told
    return f"{told} Most telling next test: {diagnosis.next_test.rstrip('.')}."


def headline(diagnosis: Diagnosis) -> str:
    """The first sentence, without names of code: what was found, what it is worth on kept sessions at the node that was
    furthest off, and what got worse there."""
    kept = kept_errors.on_kept(diagnosis)
    told = f"{words.capital(_found(diagnosis))}{': ' if kept else ''}{kept}."
    return told if len(told.split()) < LONGEST else ". ".join(map(words.capital, told.split("; ")))


def _found(diagnosis: Diagnosis) -> str:
    match ending(diagnosis):
        case Ending.NAMED:
            return _named(diagnosis)
        case Ending.UNKNOWN:
            something = verdict.something(diagnosis.unknown[0])
            if doubts.rather_lacking(diagnosis):
                something = f"the file is crude and lacks something: {something[0].lower()}{something[1:]}"
            if diagnosis.causes:
                return f"{something}, beside {words.counted(len(diagnosis.causes), 'fault')} of the record"
            return f"{something}{_but(diagnosis)}"
        case Ending.AGREES:
            return f"{_agrees(diagnosis)}{_but(diagnosis)}"
        case Ending.CANNOT_TELL:
            asked = diagnosis.shown and diagnosis.candidates
            return f"{'these sessions cannot tell why' if asked else 'nothing can be named'}{_but(diagnosis)}"


def _named(diagnosis: Diagnosis) -> str:
    first, *more = sorted(diagnosis.causes, key=lambda cause: cause.of_the_record)
    told, others = first.says, len(first.indistinguishable_from)
    if first.of_the_record:
        faults = f"and {words.counted(len(more), 'more fault')}" if more else "a fault"
        return f"{told}, {faults} of the record, left out; otherwise {_agrees(diagnosis)}{_but(diagnosis)}"
    if more:
        told += f", and {words.counted(len(more), 'more cause')}"
    elif others:
        told += f", or {words.counted(others, 'other cause')}"
    if not doubts.rather_lacking(diagnosis, first):
        return told
    return f"rather what the crude file lacks than a cause ({verdict.probability(first.probability)} probable): {told}"


def _but(diagnosis: Diagnosis) -> str:
    """What is so far beyond usual that silence would hide it, where no cause is named; "" where nothing is."""
    far = beyond_usual.furthest(diagnosis)
    return f", but {far}" if far else ""


def _agrees(diagnosis: Diagnosis) -> str:
    if verdict.within_floor(diagnosis):
        return f"the twin agrees with these sessions {verdict.OWN}"
    suffice = diagnosis.gain and kept_errors.coefficients_suffice(diagnosis.gain)
    return f"no cause beyond the file's own coefficients {'is needed' if suffice else 'has evidence'}"


def details(diagnosis: Diagnosis) -> str:
    """The sentences behind `headline`."""
    told = [kept_errors.beside(diagnosis)]
    match ending(diagnosis):
        case Ending.NAMED:
            told = [_sizes(diagnosis), *told, *two_models.notes(diagnosis)]
            told += [f"Beside that: s{verdict.unknown_sentence(heat)[1:]}" for heat in diagnosis.unknown[:1]]
        case Ending.UNKNOWN:
            first, *more = diagnosis.unknown
            start = "The candidates " if first.patchwork else ""
            told = [words.capital(start + verdict.unexplained(first)), *map(verdict.unknown_sentence, more), *told]
            told += two_models.notes(diagnosis)
            faults = "; ".join(cause.says for cause in diagnosis.causes)
            told += [f"Left out as faults of the record: {faults}."] if faults else []
        case Ending.AGREES:
            told.append(f"{diagnosis.candidates:,} candidates tried, {_best(diagnosis)}.")
        case Ending.CANNOT_TELL:
            told.append(_cannot_tell(diagnosis))
    return " ".join(filter(None, told))


def no_files(diagnosis: Diagnosis) -> str:
    """Which files are not there, and why; "" where there is no such reason."""
    why = diagnosis.why_no_files
    if not why:
        return ""
    there = {"recalibrated": diagnosis.recalibrated_model is not None, "extended": diagnosis.offers}
    missing = [name for name, written in there.items() if not written] if any(there.values()) else []
    return f"No {' and '.join(missing)}{' ' * bool(missing)}files were written: {why.rstrip('.')}."


def _sizes(diagnosis: Diagnosis) -> str:
    first, *more = diagnosis.causes
    if more:
        return f"{words.capital('; '.join(_with_size(cause) for cause in diagnosis.causes))}."
    if rivals := verdict.rivals_left(first):
        return f"These sessions cannot tell it from: {'; '.join(says for _, says in rivals)}."
    told = [("size", verdict.size(first)), ("probability", verdict.probability(first.probability))]
    return f"{words.capital(', '.join(f'its {what} is {value}' for what, value in told if value))}."


def _with_size(cause: Named) -> str:
    size, others = verdict.size(cause), len(cause.indistinguishable_from)
    apart = f", not told apart from {words.counted(others, 'other')}" if others else ""
    return f"{cause.says}{', ' + size if size else ''}{apart}"


def _best(diagnosis: Diagnosis) -> str:
    best = max(diagnosis.rivals, key=lambda rival: rival.log_bayes_factor, default=None)
    if best is None:
        return f"none with evidence ({against(diagnosis)})"
    found = f"best ln BF {words.digits(best.log_bayes_factor)} ({against(diagnosis)})"
    if best.log_bayes_factor <= diagnosis.threshold:
        return found
    return f"{found}: {best.id}, which is no cause all the same: see the rivals"


def _cannot_tell(diagnosis: Diagnosis) -> str:
    if not diagnosis.shown:
        return "No channel of these sessions observes a node of the model with usable samples."
    if not diagnosis.candidates:
        return "These sessions leave no candidate that could be tried."
    off = f"{words.joined(verdict.left_over(diagnosis))} stay above the sensors' own uncertainty"
    fits = [rival.id for rival in diagnosis.rivals if rival.log_bayes_factor > diagnosis.threshold]
    why = f"of {diagnosis.candidates:,} candidates none stands out: {_best(diagnosis)}."
    if fits:
        best = words.joined(fits[:2])
        why = f"what would explain the sessions learnt from ({best}) is no cause: see the rivals."
    return f"{words.capital(off)}, and {why}"
