"""What a diagnosis says of a case, held against what is hidden there."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from benchmarks.trial.audit import Spread, spreads
from benchmarks.trial.campaigns import Behind
from benchmarks.trial.cases import Case, Hidden, either_way
from benchmarks.trial.explained import explained
from benchmarks.trial.inside import Errors, at_sensors, inside
from benchmarks.trial.lost import lost_at
from benchmarks.trial.visibility import VISIBLE, Seen
from replay.studies.diagnosis.answer_parts import class_of
from replay.studies.diagnosis.question import Campaign
from replay.studies.diagnosis.search import find
from twin.diagnosis.crudeness import crudeness
from twin.diagnosis.evidence import TOLD_APART
from twin.diagnosis.findings import findings
from twin.diagnosis.swaps import scan
from twin.differences.everyday import everyday
from twin.errors import TwinError
from twin.fitting.model import Model

ENDS = (TwinError, ArithmeticError, ValueError, LookupError)  # of a diagnosis, without an answer
VERDICTS = ("first", "class", "place", "wrong", "silent")


@dataclass(frozen=True)
class Result:
    """What a diagnosis said of a case and its `hidden` effects. `named`: cause -> ln BF, the strongest first;
    `entered`: the terms among them as the search let them in; `groups`: of each, what the data cannot tell from it;
    `stated`: how probable the answer calls it with these (an exchange of channels has none); `refused`: what the kept
    sessions spoke against; `is_unknown`: a heat of any course won; `beside`: one is told beside what is named;
    `unknown`: ln BF of the best free heat; `linear`: of the best candidate before any refit; `leading`: after the first
    refits; `lost`: cause -> the step that lost it; `sensors`, `nodes`: errors at the kept sensors and where none sits;
    `audit` of a healthy motor; `crudeness` of its file (`twin.diagnosis.crudeness`); before any cause
    (`twin.diagnosis.findings`) the ln evidence of the `widest` family of numbers, and the number that moved `furthest`,
    in its stated sd, with `whose` it is. Of many effects at once the ln evidence that the model gains by all of them
    (`truth`) and by what is named (`gained`)."""

    case: Case
    hidden: tuple[Seen, ...] = ()
    named: Mapping[str, float] = field(default_factory=dict)
    entered: tuple[str, ...] = ()
    groups: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    stated: Mapping[str, float] = field(default_factory=dict)
    refused: tuple[str, ...] = ()
    is_unknown: bool = False
    beside: bool = False
    unknown: float = 0.0
    linear: float = 0.0
    leading: Mapping[str, float] = field(default_factory=dict)
    lost: Mapping[str, str] = field(default_factory=dict)
    sensors: Errors = field(default_factory=dict)
    nodes: Errors = field(default_factory=dict)
    audit: Mapping[str, Spread] = field(default_factory=dict)
    crudeness: float = 0.0
    widest: float = 0.0
    furthest: float = 0.0
    whose: str = ""
    truth: float | None = None
    gained: float | None = None
    improved: bool = False
    seconds: float = 0.0
    failed: str = ""

    @property
    def answer(self) -> str:
        """`silent`, `unknown`, or the first name."""
        return "unknown" if self.is_unknown else next(iter(self.named), "silent")

    @property
    def verdict(self) -> str:
        """Of a single effect: `first`, `class` (not told apart from the first name), `place` (another law there),
        `wrong` or `silent`; off the library `right` is `unknown`."""
        if self.answer == "silent":
            return "silent"
        if not self.hidden:
            return "wrong"
        return judged(self.answer, self.groups.get(self.answer, ()), self.hidden[0].cause)

    @property
    def told(self) -> list[str]:
        """Everything that the answer names, the strongest first; `unknown` for a heat that it cannot name."""
        return [*(["unknown"] if self.is_unknown or self.beside else []), *self.named]

    def is_told(self, cause: str) -> bool:
        """Whether a hidden cause is named or in a named group."""
        return any(judged(name, self.groups.get(name, ()), cause) in ("first", "class") for name in self.told)

    def of_name(self, name: str) -> str:
        """Of one of the names: the best that it is of any hidden effect, by VERDICTS."""
        found = [judged(name, self.groups.get(name, ()), one.cause) for one in self.hidden]
        return min(found, key=VERDICTS.index, default="wrong")

    @property
    def is_missed(self) -> bool:
        """Whether all hidden effects together explain the campaign better than what is named, by ln 20 at least."""
        return self.truth is not None and self.gained is not None and self.truth - self.gained > TOLD_APART

    @property
    def visible(self) -> list[Seen]:
        """The hidden effects that any method could see."""
        return [one for one in self.hidden if one.band == VISIBLE]


def judged(name: str, group: tuple[str, ...], cause: str) -> str:
    """What a name is of a hidden cause: `first` (itself), `class`, `place` or `wrong`."""
    answer = either_way(name)
    truth = either_way("unknown" if cause.startswith("unknown.") else cause)
    if answer == truth:
        return "first"
    if truth in [either_way(other) for other in group]:
        return "class"
    return "place" if answer[:2] == truth[:2] else "wrong"


def tried(case: Case, campaign: Campaign, behind: Behind, hidden: tuple[Seen, ...]) -> Result:
    """Diagnose a campaign as `whyhot diagnose` does. `hidden`: how well each effect can be seen."""
    started = time.process_time()
    train, kept = campaign.tests[: behind.learnt], campaign.tests[behind.learnt :]
    model = Model(campaign.network, train, everyday(campaign.network, train))
    swaps = scan(model, campaign.candidates)
    given = Campaign(campaign.network, train, campaign.candidates, (), (), (), ())
    found = find(given, model, swaps, list(kept), lambda _: None)
    seconds = time.process_time() - started
    naming = found.naming
    named = [(str(s.candidate.cause), s.log_bayes_factor) for s in swaps]
    named += [(str(r.candidate.cause), r.log_bayes_factor) for r in naming.accepted]
    classes = {str(refit.candidate.cause): class_of(naming, refit, found.kept) for refit in naming.accepted}
    unusual = findings(naming.rounds[0].base, model.parameters, 0.0)
    result = Result(
        case,
        hidden,
        named=dict(sorted(named, key=lambda one: -one[1])),
        entered=tuple(str(refit.candidate.cause) for refit in naming.accepted),
        groups={name: tuple(str(m.candidate.cause) for m in one.others) for name, one in classes.items()},
        stated={name: one.probability for name, one in classes.items()},
        refused=tuple(str(refit.candidate.cause) for refit, _ in found.refused),
        is_unknown=naming.is_unknown,
        beside=bool(found.unknown) and not naming.is_unknown,
        unknown=naming.log_bf_unknown,
        linear=float(naming.rounds[0].scores.log_bayes_factor.max()),
        leading={str(r.candidate.cause): round(r.log_bayes_factor, 1) for r in naming.rounds[0].refits},
        sensors=at_sensors(found),
        nodes=inside(found, campaign.network, kept, behind.nodes),
        audit={} if hidden else spreads(naming.rounds[0].base),
        crudeness=crudeness(naming.rounds[0].base, model.parameters),
        widest=max((one.log_evidence for one in unusual.wide), default=0.0),
        furthest=abs(unusual.moved[0].usual) if unusual.moved else 0.0,
        whose=model.parameters[unusual.moved[0].place].name if unusual.moved else "",
        improved=found.kept is not None and found.kept.improved,
        seconds=seconds,
    )
    if case.kind == "many":
        causes = [effect.cause for effect in behind.effects]
        truth, gained = explained(naming, model.parameters, campaign.candidates, causes)
        result = replace(result, truth=truth, gained=gained)
    missed = [one.cause for one in hidden if not result.is_told(one.cause)]
    return replace(result, lost={cause: lost_at(found, cause, campaign.candidates) for cause in missed})


# --- Kept results -----------------------------------------------------------------------------------------------------


def written(path: Path, result: Result) -> None:
    """Add a result to those that are there."""
    with path.open("a", encoding="utf-8") as file:
        file.write(json.dumps(asdict(result)) + "\n")


def read_results(path: Path) -> list[Result]:
    """Results that are there already."""
    if not path.exists():
        return []
    return [_read(json.loads(line)) for line in path.read_text(encoding="utf-8").splitlines()]


def _read(row: dict[str, Any]) -> Result:
    case = {**row["case"], "hidden": tuple(Hidden(**one) for one in row["case"]["hidden"])}
    return Result(
        **{
            **row,
            "case": Case(**case),
            "hidden": tuple(Seen(**one) for one in row["hidden"]),
            "groups": {cause: tuple(others) for cause, others in row["groups"].items()},
            "entered": tuple(row["entered"]),
            "refused": tuple(row["refused"]),
            "audit": {family: Spread(**one) for family, one in row["audit"].items()},
        }
    )
