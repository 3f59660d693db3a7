"""What is unusual in a calibrated motor, in sentences: what a reader should know before any cause."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from replay.show.reports import verdict
from replay.show.words import words
from replay.studies.diagnosis.answer import Diagnosis, Unusual

SHOWN = 2  # findings at most, and as many that a cause took away


def told(diagnosis: Diagnosis) -> Iterator[str]:
    """The strongest findings with what would make them sharper, how many more there are, and what a cause took away."""
    unusual = of_last_fit(diagnosis)
    sharper = ""
    for one in unusual[:SHOWN]:
        yield f"{sentence(diagnosis, one)}{f'. Better known with {one.sharper}' if one.sharper != sharper else ''}"
        sharper = one.sharper
    if len(unusual) > SHOWN:
        yield f"and {len(unusual) - SHOWN} more in the report"
    if far := how_many(diagnosis):
        yield far
    if gone := taken_away(diagnosis):
        yield gone


def furthest(diagnosis: Diagnosis) -> str:
    """What no healthy motor does, without a full stop: the number that moved furthest, by UNUSUAL sd and more, or else
    the widest family; "" where there is neither. Of 20 healthy motors no number went 3.4 sd, and no family's evidence
    was above 2.3 (`benchmarks/trials.py` prints `how far beyond usual`)."""
    unusual = of_last_fit(diagnosis)
    far = [one for one in filter(_is_number, unusual) if abs(one.times_usual) >= verdict.UNUSUAL]
    if far:
        one = max(far, key=lambda number: abs(number.times_usual))
        return f"{_whose(diagnosis, one)} had to {_verb(one)} by {_how_far(one)}"
    family = next((one for one in unusual if one.about == "family"), None)
    return f"with the {family.says} {_how_far(family)}" if family else ""


def how_many(diagnosis: Diagnosis) -> str:
    """ "Numbers that moved further than usual: 12 without the cause, 7 with it"; "" where none had."""
    far = Counter(one.when for one in filter(_is_number, diagnosis.findings))
    terms = _terms(diagnosis)
    cause = ("the causes", "them") if terms > 1 else ("the cause", "it")
    each = f"{far['before']} without {cause[0]}, {far['after']} with {cause[1]}" if terms else far["before"]
    return f"Numbers of the file, its sensors and its sessions that moved further than usual: {each}" if far else ""


def _terms(diagnosis: Diagnosis) -> int:
    """How many causes the last fit has that the first has not: exchanged channels are put right before both."""
    return sum(not verdict.is_exchange(cause) for cause in diagnosis.fitted_with)


def _is_number(one: Unusual) -> bool:
    return one.about != "family" and one.kind != "temperature"


def of_last_fit(diagnosis: Diagnosis) -> list[Unusual]:
    """What is unusual in the fit with the causes where there are any."""
    when = "after" if _terms(diagnosis) else "before"
    return [one for one in diagnosis.findings if one.when == when]


def taken_away(diagnosis: Diagnosis) -> str:
    """What is beyond usual without the causes and no longer with them; "" where nothing is."""
    left = {(one.says, one.session) for one in of_last_fit(diagnosis)}
    gone = [one for one in diagnosis.findings if one.when == "before" and (one.says, one.session) not in left]
    names = [f"{_whose(diagnosis, one)} ({'at its bound' if one.bound else _how_far(one)})" for one in gone[:SHOWN]]
    more = [f"{len(gone) - SHOWN} more"] if len(gone) > SHOWN else []
    cause = "causes" if _terms(diagnosis) > 1 else "cause"
    return f"No longer beyond usual with the {cause}: {words.joined([*names, *more])}" if gone else ""


def sentence(diagnosis: Diagnosis, one: Unusual) -> str:
    """One finding with its size, without a full stop."""
    subject = words.capital(_whose(diagnosis, one))
    if one.log_evidence is not None:
        return f"{subject}: {_how_far(one)} (ln evidence {verdict.signed(one.log_evidence)})"
    size = f": {verdict.amount(one.estimate, one.ci95, one.unit)}" if one.estimate is not None else ""
    bound = f". It ended at its bound, {one.bound}" if one.bound else ""
    return f"{subject} had to {_verb(one)} by {_how_far(one)}{size}{bound}"


def _whose(diagnosis: Diagnosis, one: Unusual) -> str:
    where = f" in {verdict.session_name(diagnosis, one.session)}" if one.session else ""
    return f"{one.says}{where}"


def _verb(one: Unusual) -> str:
    if one.says.startswith("how "):
        return "change"
    return "grow" if one.times_usual > 0 else "shrink"


def _how_far(one: Unusual) -> str:
    """ "3.1 times as far from the file as usual", "2.3 sd"."""
    family = one.about == "family"
    return f"{one.times_usual:.1f} times as far from the file as usual" if family else f"{abs(one.times_usual):.1f} sd"
