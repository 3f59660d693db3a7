"""The files that a diagnosis offers: recalibrated, and with every cause that a file can say, as far as they replay."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from ingest.errors import IngestError
from replay.errors import MotorFileError
from replay.studies.diagnosis.as_recorded import AsRecorded, as_recorded
from replay.studies.diagnosis.extension import Version, version
from replay.studies.diagnosis.question import Campaign, Question
from replay.studies.diagnosis.search import Found
from twin.errors import DivergedError, TwinError
from twin.fitting.model import Test


@dataclass(frozen=True)
class Offered:
    """The versions recalibrated (`before`) and with what was named (`after`), where there are such, `why_none` where
    one is missing; and the kept sessions replayed with these and as `published`, up to the first that runs away."""

    files: Mapping[str, Version]
    why_none: str | None
    runs: Mapping[str, AsRecorded]


def offered(question: Question, campaign: Campaign, found: Found, identity: str, kept: Sequence[Test]) -> Offered:
    """Write the versions and replay the `kept` sessions with each; without any, those that were learnt from."""
    files, why = _written(question, campaign, found, identity, kept)
    sessions, tests = (question.kept, kept) if kept else (question.train, campaign.tests)
    runs: dict[str, AsRecorded] = {}
    ran_away: dict[str, str] = {}
    for when, one in {"published": Version(question.model, None), **files}.items():
        try:
            ran = as_recorded(question, one, sessions, tests)
        except DivergedError as error:
            ran_away[when] = f"in a replay {error}"
        else:
            runs |= {} if ran_away or not kept else {when: ran}
    left = {when: one for when, one in files.items() if when not in ran_away}
    return Offered(left, why or next((ran_away[when] for when in files if when in ran_away), None), runs)


def _written(
    question: Question, campaign: Campaign, found: Found, identity: str, kept: Sequence[Test]
) -> tuple[dict[str, Version], str | None]:
    """The versions, where a file can say them, and why there are none, where it cannot: what was found is said all the
    same."""
    try:
        note = f"Recalibrated by diagnosis {identity}."
        before = version(question, campaign, found.base, (), (), note, kept)
        after = _extended(question, campaign, found, identity, kept)
    except (IngestError, MotorFileError, TwinError) as error:
        return {}, str(error)
    return {"before": before} | ({"after": after} if after else {}), None


def _extended(
    question: Question, campaign: Campaign, found: Found, identity: str, kept: Sequence[Test]
) -> Version | None:
    """With every cause that was named, or an unknown heat that is a map, whether the kept sessions got better or not;
    None where a file can say none."""
    named = [str(refit.candidate.cause) for refit in found.naming.accepted if refit.candidate.sayable]
    named += [str(swap.candidate.cause) for swap in found.swaps]
    named += [found.naming.map_said] if found.naming.map_said else []
    if not named:  # what changes from session to session is said by no file
        return None
    note = f"Extended by diagnosis {identity}: {', '.join(named)}."
    return version(question, campaign, found.naming.final, found.naming.accepted, found.swaps, note, kept)
