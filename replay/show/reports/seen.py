"""What `whyhot seen` says: in which sessions of which motors the cause of a diagnosis acts, and since when."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Sequence
from typing import Any

from ingest.catalogue.page import table
from replay.show.reports import doubts
from replay.show.words import words
from replay.show.words.terminal import labelled
from replay.show.words.width import width
from replay.studies.since.acting import Since
from replay.studies.since.seen import SeenElsewhere, SeenMotor

SURELY = ">99 %"
SURE = 0.95  # from which probability on a motor counts as one that has the cause; below 1 - SURE as one that has not


def document(found: SeenElsewhere) -> dict[str, Any]:
    """`whyhot.seen/1`."""
    return {
        "schema": "whyhot.seen/1",
        "diagnosis": found.diagnosis.diagnosis,
        "motor": found.diagnosis.motor,
        "cause": found.cause.id,
        "motors": [_motor(one) for one in found.motors],
        "in_doubt": doubts.told(found.diagnosis),
        "not_asked": list(found.not_asked),
    }


def _motor(one: SeenMotor) -> dict[str, Any]:
    return {
        "specimen": one.specimen,
        "probability": one.probability,
        "amplitude": one.amplitude,
        "sd": one.sd,
        "since": since_json(one.since),
        "sessions": [
            {
                "session": own.session.session,
                "name": own.session.name,
                "probability": own.probability,
                "learnt_from": own.learnt_from,
            }
            for own in one.sessions
        ],
    }


def since_json(since: Sequence[Since]) -> list[dict[str, Any]]:
    """The sets of sessions, as JSON."""
    return [{"says": list(one.says), "probability": one.probability} for one in since]


def seen_text(found: SeenElsewhere) -> str:
    """The answer first, then every session. No colours, no trailing newline."""
    lines = labelled("Answer", answer(found))
    for motor in found.motors:
        if told := _since(motor):
            lines += labelled(motor.specimen or "No specimen", told)
    lines += labelled("In doubt", *doubts.told(found.diagnosis))
    head = ("specimen", "session", "kind", "acts", "")
    lines += ["", *table(head, list(_rows(found)), width(), right=(3,))]
    last = found.motors[0].sessions[-1].session.name
    return "\n".join([*lines, "", f"next: whyhot show {shlex.quote(last)}"])


def answer(found: SeenElsewhere) -> str:
    """How many motors have the cause, have not, or cannot tell."""
    ill = [one for one in found.motors if one.probability >= SURE]
    well = [one for one in found.motors if one.probability <= 1 - SURE]
    total = words.counted(len(found.motors), "motor")
    sure = f"({percent(SURE)} sure or more)"
    told = f"{found.cause.id} of d-{found.diagnosis.diagnosis[:8]} acts in {len(ill)} of {total} {sure}"
    open_ = len(found.motors) - len(ill) - len(well)
    rest = [f"not in {len(well)}"] * bool(well) + [f"{open_} cannot tell"] * bool(open_)
    return f"{'; '.join([told, *rest])}."


def _since(motor: SeenMotor) -> str:
    """When it began, where the motor may have it."""
    if motor.amplitude is None:
        return "nothing that these sessions read would move with it"
    told = f"{percent(motor.probability)} that it acts"
    if motor.probability < 0.5:
        return told
    return f"{told}: {since_says(motor.since, motor.probability)}"


def since_says(since: Sequence[Since], total: float) -> str:
    """ "since 3_s1 (where inverter = sw 4.2), 97 %; since 2_wltp, 3 %": the sets that matter, as shares of `total`; one
    that leaves no other a percent without its share."""
    likely = [(one, percent(one.probability / total)) for one in since[:3] if one.probability > 0.02 * total]
    return "; ".join(called(one.says) + f", {share}" * (share != SURELY) for one, share in likely)


def called(says: Sequence[str]) -> str:
    """ "since 3_s1 (the sessions with inverter = sw 4.2)": sets of sessions that are the same are said together."""
    first, *more = says
    if not first.startswith(("since ", "in all")):
        first, more = f"with {first}", list(more)
    return f"{first} (where {words.joined(more)})" if more else first


def _rows(found: SeenElsewhere) -> Iterator[tuple[str, ...]]:
    for motor in found.motors:
        for one in motor.sessions:
            note = "learnt from" if one.learnt_from else ""
            yield motor.specimen or "", one.session.name, one.session.kind, percent(one.probability), note


def percent(probability: float) -> str:
    """ "97 %"; never quite nothing or all."""
    if probability > 0.995:
        return SURELY
    return "<1 %" if probability < 0.005 else f"{100 * probability:.0f} %"
