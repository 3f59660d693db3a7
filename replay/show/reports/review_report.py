"""The page of a change that a colleague can sign: one HTML file that needs no other and prints on A4."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from replay.show.reports import doubts, verdict
from replay.show.reports.diagnosis_report import marked
from replay.show.reports.diagnosis_text import diagnosis_name
from replay.show.reports.report import ReportContext
from replay.show.words import words
from replay.show.words.page import template
from replay.show.words.terminal import labelled
from replay.studies.diagnosis.answer import Named
from replay.studies.diagnosis.review import Review, ReviewedKind
from replay.written import write


def write_review(found: Review, target: Path, context: ReportContext) -> None:
    """Write the page to `target`. The same change gives the same bytes."""
    page = template("review.html.j2").render(
        diagnosis=found.diagnosis,
        name=diagnosis_name(found.diagnosis),
        answer=answer(found),
        standing=standing(found),
        causes=in_files(found),
        in_doubt=doubts.told(found.diagnosis),
        files=[vars(one) | {"lines": marked(one.diff)} for one in found.replaced],
        kinds=found.by_kind(),
        readings=found.readings,
        built_on=built_on(found),
        verdict=verdict,
        context=context,
    )
    write(target, page)


def in_files(found: Review) -> list[Named]:
    """The causes that the files have."""
    return [one for one in found.diagnosis.causes if one.id in found.causes]


def answer(found: Review) -> str:
    """What is to be signed, in a sentence."""
    files = words.joined([f"{one.what} {words.short(one.new)}" for one in found.replaced])
    return f"{words.joined(found.causes) or 'a calibration'} in {files}: {_gain(found.by_kind())}"


def _gain(kinds: list[ReviewedKind]) -> str:
    """The node that gets most better and, where there is one, that gets most worse; on kept sessions where some are."""
    shown = [one for one in kinds if one.kept] or kinds
    moved = sorted(((one.after_K - one.before_K, one) for one in shown if one.after_K is not None), key=lambda m: m[0])
    if not moved:
        return "the motor file stays, and with it what replays are off by."
    ends = [moved[0], *moved[-1:]] if moved[-1][0] >= 0.05 else moved[:1]
    told = [f"{words.name(one.node)} {words.became([one.before_K, one.after_K])} K in {one.kind}" for _, one in ends]
    of = "kept sessions" if shown[0].kept else "the sessions learnt from, as none was kept"
    return f"{'; worse: '.join(told)} ({of})."


def standing(found: Review) -> str:
    """Whether it is current, since when."""
    if found.accepted is None:
        return "Offered, not accepted."
    return f"Accepted {found.accepted.recorded[:16].replace('T', ' ')} UTC, event {found.accepted.position}."


def built_on(found: Review) -> str:
    """What would have to be asked again were it taken back."""
    return f"Made with it since, beside the replays shown here: {words.joined(found.built_on) or 'nothing'}."


def document(found: Review) -> dict[str, Any]:
    """`whyhot.review/1`."""
    return {
        "schema": "whyhot.review/1",
        "diagnosis": found.diagnosis.diagnosis,
        "causes": list(found.causes),
        "accepted": found.accepted.position if found.accepted else None,
        "replaced": [vars(one) for one in found.replaced],
        "in_doubt": doubts.told(found.diagnosis),
        "not_told_apart": {one.id: list(one.indistinguishable_from) for one in in_files(found)},
        "by_kind": [vars(one) for one in found.by_kind()],
        "built_on": list(found.built_on),
        "readings": [
            vars(one) | {"session": one.session.session, "name": one.session.name, "runs": list(one.runs)}
            for one in found.readings
        ],
    }


def review_text(found: Review, target: Path) -> str:
    """What `whyhot review` prints."""
    lines = labelled("Change", answer(found))
    lines += labelled("In doubt", *doubts.told(found.diagnosis))
    lines += labelled("Standing", standing(found))
    lines += labelled("Built on it", built_on(found))
    lines += [f"{target}   opens offline in any browser", ""]
    name = diagnosis_name(found.diagnosis)
    onward = f"whyhot lineage {name}" if found.accepted else f"whyhot accept {name}"
    return "\n".join([*lines, *labelled("Next", onward)])
