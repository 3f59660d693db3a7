"""The chain of a diagnosis: what each term that was let in brought, on sessions left out and on kept ones, and the
files of the motor up to there."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ingest.errors import IngestError
from replay.errors import MotorFileError
from replay.studies.diagnosis.answer import ChainStep, Named
from replay.studies.diagnosis.answer_parts import place_of
from replay.studies.diagnosis.as_recorded import AsRecorded, as_recorded
from replay.studies.diagnosis.extension import Version, version
from replay.studies.diagnosis.formulas import formula
from replay.studies.diagnosis.kept_sessions import node_of
from replay.studies.diagnosis.offered import Offered
from replay.studies.diagnosis.question import Campaign, Question
from replay.studies.diagnosis.search import Found
from twin.diagnosis.free_heats import knots_of
from twin.diagnosis.left_out import LeftOut, left_out
from twin.diagnosis.naming import Naming, without_heat, without_term
from twin.diagnosis.rounds import Refit
from twin.errors import DivergedError, TwinError
from twin.fitting.fit import Fit, fit
from twin.fitting.model import Model, Test
from twin.motor.network import Map, Term

PUBLISHED, RECALIBRATED = -1, 0  # steps before the first term


def chain(
    question: Question,
    campaign: Campaign,
    found: Found,
    files: Offered,
    causes: Sequence[Named],
    kept: Sequence[Test],
    identity: str,
) -> list[ChainStep]:
    """The steps, the file as published first. `kept`: the kept tests as recorded."""
    if found.swaps:  # as published and with channels exchanged back, the sessions are not the same
        return []
    nodes = {channel.name: node_of(channel) for test in campaign.tests for channel in test.channels}
    build = _Build(question, campaign, kept, nodes)
    entries = _entries(found.naming, causes)
    before = left_out(_as_published(found.base))
    steps = [build.step(PUBLISHED, before, None, Version(question.model, None), files.runs.get("published"))]
    for number, reached in enumerate(_fits(found)):
        after = left_out(reached)
        entry = entries[number - 1] if number else None
        if number in (RECALIBRATED, len(entries)):
            when = "after" if number else "before"
            files_of, ran = files.files.get(when), files.runs.get(when)
        else:
            first = [one.id for one in entries[:number]]
            files_of, ran = build.files(reached, found.naming.accepted[:number], first, identity)
        steps.append(build.step(number, after, before, files_of, ran, entry))
        before = after
    return steps


def _as_published(base: Fit) -> Fit:
    """The file with nothing learnt."""
    model = Model(base.model.network, base.model.tests, (), base.model.noise)
    return fit(model, np.zeros(0))


def _fits(found: Found) -> list[Fit]:
    """Recalibrated alone, then with each term more, a map last, all under the noise and the priors of the last."""
    naming = found.naming
    calm = naming.rounds[0].base.beta
    fits = [naming.final] if naming.learnt else []
    if naming.map_id and naming.accepted:
        fits.append(without_heat(naming.final))
    for refit in reversed(naming.accepted[1:]):
        fits.append(without_term(fits[-1], place_of(fits[-1], refit), calm))
    return [found.base, *reversed(fits)]


@dataclass(frozen=True)
class _Entry:
    """What a step adds, in the words of the answer."""

    id: str
    told_together: Sequence[str]
    formula: str
    log_bayes_factor: float


def _entries(naming: Naming, causes: Sequence[Named]) -> list[_Entry]:
    """Each term, then the map."""
    said = {cause.id: cause for cause in causes}
    named = [said[str(refit.candidate.cause)] for refit in naming.accepted]
    found = [_Entry(one.id, one.indistinguishable_from, one.formula, one.log_bayes_factor) for one in named]
    if naming.heat and naming.map_id:
        knots = knots_of(naming.final.model)
        table = Map(knots.speeds, knots.loads, (), knots.load)
        written = formula(Term(1.0, shape=table), naming.heat.node, naming.final.model.network)
        found.append(_Entry(naming.map_id, [], written, naming.heat.log_bayes_factor))
    return found


@dataclass(frozen=True)
class _Build:
    """What every step of one chain shares."""

    question: Question
    campaign: Campaign
    kept: Sequence[Test]
    nodes: Mapping[str, str]

    def step(
        self,
        number: int,
        after: LeftOut,
        before: LeftOut | None,
        files: Version | None,
        ran: AsRecorded | None,
        entry: _Entry | None = None,
    ) -> ChainStep:
        """One step in the words of the answer."""
        if ran is None and files is not None and self.kept:
            ran = self._ran(files)
        better = 0 if before is None else int(np.sum(after.by_session_K() < before.by_session_K()))
        errors = {
            channel: float(np.abs(residual).mean()) for channel, residual in (ran.residual if ran else {}).items()
        }
        return ChainStep(
            step=number,
            id=entry.id if entry else None,
            told_together=list(entry.told_together) if entry else [],
            formula=entry.formula if entry else "",
            log_bayes_factor=entry.log_bayes_factor if entry else None,
            sessions_better=better,
            sessions=len(self.campaign.tests),
            left_out_mae_K=self._by_node(after.by_channel_K()),
            kept_mae_K=self._by_node(errors),
            model=files.motor if files else None,
            bench=files.bench if files else None,
            benches=dict(files.benches) if files else {},
        )

    def files(
        self, reached: Fit, named: Sequence[Refit], first: Sequence[str], identity: str
    ) -> tuple[Version | None, AsRecorded | None]:
        """The files with the `first` terms, by their ids, and the kept sessions replayed with them, where there are
        such; no files where these cannot say the terms, or a replay with them runs away."""
        note = f"The first {len(first)} of diagnosis {identity}: {', '.join(first)}."
        try:
            made = version(self.question, self.campaign, reached, named, (), note)
        except (IngestError, MotorFileError, TwinError):
            return None, None
        ran = self._ran(made)
        return (None, None) if ran is None else (made, ran if self.kept else None)

    def _ran(self, files: Version) -> AsRecorded | None:
        """The kept sessions replayed, without any those that were learnt from; None where the motor runs away."""
        question = self.question
        sessions, tests = (question.kept, self.kept) if self.kept else (question.train, self.campaign.tests)
        try:
            return as_recorded(question, files, sessions, tests)
        except DivergedError:
            return None

    def _by_node(self, of_channel: Mapping[str, float]) -> dict[str, float]:
        """Mean over the channels of each node; meters have none."""
        found: defaultdict[str, list[float]] = defaultdict(list)
        for channel, error in of_channel.items():
            if channel in self.nodes:
                found[self.nodes[channel]].append(error)
        return {node: float(np.mean(errors)) for node, errors in found.items()}
