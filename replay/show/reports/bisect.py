"""What `whyhot bisect` says: where the residual of a channel began, of which causes, and what changed there."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from typing import Any

from ingest.catalogue.page import table
from replay.show.reports import doubts
from replay.show.reports.seen import called, percent, since_json, since_says
from replay.show.words import words
from replay.show.words.terminal import labelled
from replay.show.words.width import width
from replay.studies.since.bisect import Bisected
from twin.diagnosis.crudeness import USUAL


def document(found: Bisected) -> dict[str, Any]:
    """`whyhot.bisect/1`."""
    return {
        "schema": "whyhot.bisect/1",
        "channel": found.channel,
        "motor": found.motor,
        "model": found.model,
        "specimen": found.specimen,
        "nothing_began": found.none,
        "crudeness": found.crudeness,
        "since": since_json(found.since),
        "first": found.first.session if found.first else None,
        "before": found.before.session if found.before else None,
        "causes": [
            {
                "id": one.cause,
                "since": list(one.since),
                "probability": one.probability,
                "amplitude": one.amplitude,
                "sd": one.sd,
            }
            for one in found.causes
        ],
        "sessions": [
            {
                "session": one.session.session,
                "name": one.session.name,
                "published_K": one.published_K,
                "fitted_K": one.fitted_K,
                "probability": one.probability,
            }
            for one in found.residuals
        ],
        "changes": [vars(one) for one in found.changed],
        "versions": [vars(one) for one in found.versions],
    }


def bisect_text(found: Bisected) -> str:
    """The answer first, then every session, cause, change and version. No colours, no trailing newline."""
    lines = labelled("Answer", answer(found))
    causes = (f"{one.cause} {called(one.since[:1])}, {percent(one.probability)}" for one in found.causes[:3])
    lines += labelled("May be", *causes)
    lines += labelled("In doubt", *filter(None, [_in_doubt(found)]))
    if found.first:
        lines += labelled("Changed", *_changed(found))
    head = ("session", "kind", "reads beyond model", "healthy fit", "acts")
    lines += ["", *table(head, list(_rows(found)), width(), right=(2, 3, 4))]
    if len(found.versions) > 1:
        lines += ["", *labelled("Motor files", _versions(found))]
    return "\n".join([*lines, "", f"next: {_next(found)}"])


def answer(found: Bisected) -> str:
    """Whether and since when."""
    if found.none >= 0.5:
        return (
            f"Nothing that moves {found.channel} need have begun in these sessions ({percent(found.none)}): what it "
            "reads is within what a healthy motor may do."
        )
    began = since_says(found.since, 1.0 - found.none)
    return f"{percent(1.0 - found.none)} that something moves {found.channel}; if so, {began}."


def _in_doubt(found: Bisected) -> str:
    """What is in doubt of something that moves the channel in all sessions: a file that lacks it does so, too."""
    if found.none >= 0.5 or found.before or found.crudeness <= USUAL:
        return ""
    return (
        f"The file's numbers had to move {doubts.times(found.crudeness)} usual, as they do beside a large cause, and "
        f"where a file of few parts lacks some: that moves {found.channel} in all sessions, too. A diagnosis with "
        "sessions kept tells them apart."
    )


def _changed(found: Bisected) -> list[str]:
    assert found.before and found.first, "asked only where something began between two sessions"
    told = [f"#{one.position} {(one.recorded or '')[:16].replace('T', ' ')}: {one.says}" for one in found.changed]
    return told or [f"the store knows of nothing between {found.before.name} and {found.first.name}."]


def _rows(found: Bisected) -> Iterator[tuple[str, ...]]:
    for one in found.residuals:
        means = ["" if value is None else words.signed_kelvin(value) for value in (one.published_K, one.fitted_K)]
        yield one.session.name, one.session.kind, *means, percent(one.probability)


def _versions(found: Bisected) -> str:
    """The mean error of the channel with each version."""
    errors_K = words.figures([one.mae_K for one in found.versions])
    told = (
        f"{words.short(one.model)} {'does not run' if one.mae_K is None else f'{figure} K'}"
        for one, figure in zip(found.versions, errors_K, strict=True)
    )
    return f"mean error of {found.channel}, first version first: {' -> '.join(told)}"


def _next(found: Bisected) -> str:
    if found.before and found.first:
        return f"whyhot replay {shlex.quote(found.before.name)} {shlex.quote(found.first.name)}"
    names = " ".join(shlex.quote(one.session.name) for one in found.residuals)
    return f"whyhot diagnose --on {names}"
