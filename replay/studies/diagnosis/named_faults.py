"""Faults of the record as causes: exchanged channels, samples that were masked, sensors that say nothing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ingest.facts.events import SessionRecorded
from replay.studies.diagnosis.answer import Masked, Named
from replay.studies.diagnosis.answer_parts import NOBODY_KEPT
from replay.studies.diagnosis.data_faults import DataFault
from replay.studies.diagnosis.kept_sessions import Measured
from replay.studies.diagnosis.question import Campaign, Question
from twin.diagnosis.swaps import Swap
from twin.motor.causes import Cause, says


def named_swap(swap: Swap, kept: Measured | None) -> Named:
    """Two exchanged channels, as a cause."""
    improved = kept is not None and kept.improved
    return replace(_named(swap.candidate.cause, 1.0, swap.log_bayes_factor, improved, kept), sayable=True)


def named_fault(fault: DataFault, kept: Measured | None) -> Named:
    """Masked samples of a channel, as a cause."""
    improved = kept is not None and kept.masked_better.get(fault.channel, False)
    return _named(fault.cause, fault.masked_share, fault.log_bayes_factor, improved, kept)


def _named(cause: Cause, estimate: float, log_bf: float, improved: bool, kept: Measured | None) -> Named:
    """A fault of the data as a cause: it has no term, and nothing else looks like it."""
    why = "the kept sessions do not show it" if kept else NOBODY_KEPT
    return Named(
        id=str(cause),
        says=says(cause),
        members=[],
        estimate=estimate,
        ci95=[estimate, estimate],
        unit="1",
        typical_W=None,
        largest_effect_K=0.0,
        largest_effect_node=cause.place.partition("@")[0],
        largest_effect_session="",
        largest_effect_t_s=0.0,
        formula="",
        log_bayes_factor=log_bf,
        probability=float(1 / (1 + np.exp(-min(log_bf, 700.0)))),  # against no fault, even odds before
        member_probability=1.0,
        indistinguishable_from=[],
        separating_test=None,
        significant=True,
        identified=True,
        improved=improved,
        why_not_improved=None if improved else why,
        sayable=False,
    )


def left_out(question: Question, campaign: Campaign) -> list[Masked]:
    """Sensors of the motor that say nothing usable in a whole session."""
    found = []
    for session, test, channels in zip(question.train, campaign.tests, campaign.loaded, strict=True):
        silent = {c.spec.name for c in channels} - {c.name for c in test.channels}
        for name in (observed.name for observed in campaign.observed if observed.name in silent):
            found.append(_masked(session, name, "has no usable sample in this session: left out"))
    return found


def masked(question: Question, faults: Sequence[DataFault]) -> list[Masked]:
    """What of each session was masked."""
    return [
        _masked(question.train[s], fault.channel, words) for fault in faults for s, words in sorted(fault.says.items())
    ]


def _masked(session: SessionRecorded, channel: str, words: str) -> Masked:
    return Masked(session=session.session, session_name=session.name, channel=channel, says=f"{channel} {words}")
