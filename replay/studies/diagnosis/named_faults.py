"""Faults of the record as causes: exchanged channels, samples that were masked, sensors that say nothing."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from replay.studies.diagnosis.answer import Masked, Named
from replay.studies.diagnosis.data_faults import DataFault
from replay.studies.diagnosis.kept_sessions import Measured
from replay.studies.diagnosis.question import Campaign, Question
from twin.diagnosis.swaps import Swap
from twin.motor.causes import says


def named_swap(swap: Swap, kept: Measured | None) -> Named:
    """Two exchanged channels, as a cause."""
    improved = kept is not None and kept.improved
    return _plain(
        str(swap.candidate.cause), says(swap.candidate.cause), 1.0, "1", swap.log_bayes_factor, improved, kept
    )


def named_fault(fault: DataFault, kept: Measured | None) -> Named:
    """Masked samples of a channel, as a cause."""
    improved = kept is not None and kept.masked_better.get(fault.channel, False)
    return _plain(str(fault.cause), says(fault.cause), fault.masked_share, "1", fault.log_bayes_factor, improved, kept)


def _plain(
    name: str, words: str, estimate: float, unit: str, log_bf: float, improved: bool, kept: Measured | None
) -> Named:
    """A fault of the data: it has no term, and nothing else looks like it."""
    why = "the kept sessions do not show it" if kept else "no session was kept: say --hold-out"
    return Named(
        id=name,
        says=words,
        members=[],
        estimate=estimate,
        ci95=[estimate, estimate],
        unit=unit,
        typical_W=None,
        largest_effect_K=0.0,
        largest_effect_node=name.split(".")[1].partition("@")[0],
        largest_effect_session="",
        largest_effect_t_s=0.0,
        formula="",
        log_bayes_factor=log_bf,
        probability=probability_against_none(log_bf),
        member_probability=1.0,
        indistinguishable_from=[],
        separating_test=None,
        significant=True,
        identified=True,
        improved=improved,
        why_not_improved=None if improved else why,
    )


def probability_against_none(log_bf: float) -> float:
    """Of a fault that stands alone against no fault, even odds before."""
    return float(1 / (1 + np.exp(-min(log_bf, 700.0))))


def left_out(question: Question, campaign: Campaign) -> list[Masked]:
    """Sensors of the motor that say nothing usable in a whole session."""
    found = []
    for session, test, channels in zip(question.train, campaign.tests, campaign.loaded, strict=True):
        there = {c.spec.name for c in channels}
        used = {c.name for c in test.channels}
        for observed in campaign.observed:
            if observed.name in there - used:
                found.append(
                    Masked(
                        session=session.session,
                        session_name=session.name,
                        channel=observed.name,
                        says=f"{observed.name} has no usable sample in this session: left out",
                    )
                )
    return found


def masked(question: Question, faults: Sequence[DataFault]) -> list[Masked]:
    """What of each session was masked."""
    return [
        Masked(
            session=question.train[s].session,
            session_name=question.train[s].name,
            channel=fault.channel,
            says=f"{fault.channel} {words}",
        )
        for fault in faults
        for s, words in sorted(fault.says.items())
    ]
