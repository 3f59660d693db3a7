"""Sessions that contradict each other, as the answer says it."""

from __future__ import annotations

from collections.abc import Sequence

from ingest.facts.events import SessionRecorded
from replay.studies.diagnosis.answer import Contradicting
from replay.studies.diagnosis.answer_parts import with_unit
from twin.diagnosis.contradictions import contradictions
from twin.fitting.model import Model
from twin.motor.features import scale


def contradicting(model: Model, sessions: Sequence[SessionRecorded]) -> list[Contradicting]:
    """Pairs of the `sessions` learnt from that ran alike and were read differently."""
    network = model.network
    labels = {c.name: c.sensor.label for test in model.tests for c in test.channels}
    return [
        Contradicting(
            sessions=[sessions[test].session for test in one.tests],
            t_s=list(one.at_s),
            at={with_unit(name): value * scale(network, name) for name, value in (one.inputs or {}).items()},
            channel=one.channel,
            node=labels[one.channel],
            differ_K=one.differ_K,
            sd_K=one.sd_K,
        )
        for one in contradictions(model)
    ]
