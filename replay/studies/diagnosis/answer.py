"""What a diagnosis says, as data: one dataclass, and `document` its one serialisation (`whyhot.diagnosis/1`)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from replay.engine.results.as_json import IF_SAID, from_json, to_json

SCHEMA = "whyhot.diagnosis/1"


@dataclass(frozen=True, kw_only=True)
class Shown:
    """What the model as published gets wrong at one channel of one session, before anything is fitted [K]. `floor_K`:
    what no model could go below; `white`: the residual is as the sensor's noise; `where`: range of each input in which
    the error is largest, quantity with unit -> [from, to]."""

    session: str
    session_name: str
    channel: str
    node: str
    mae_K: float
    max_K: float
    bias_K: float
    floor_K: float
    white: bool
    where: dict[str, list[float]]


@dataclass(frozen=True, kw_only=True)
class Unusual:
    """What a healthy motor's freedom had to do beyond usual. `about`: "family" (a family of numbers is further from the
    file than usual), "moved" (one number had to go far) or "bound" (one ended at its `bound`).
    `when`: "before", recalibrated without a cause, or "after", with the causes. `kind` and `place` as in cause ids
    (place None for a family), or `kind` "temperature" of a node where no sensor sits, against what the file has at its
    hottest moment; `says` what it is in words, `session` whose it is (None: of all).

    `times_usual`: width of a family over the stated one; of one number its size over the stated sd, signed.
    `log_evidence`: ln of how much more likely the sessions are with the family's width. `estimate` and `ci95` (of one
    number) in `unit`, "1" for a share of what the file says. `sharper`: the test that would tell more."""

    about: str
    when: str
    kind: str
    place: str | None = None
    says: str
    session: str | None = None
    times_usual: float
    log_evidence: float | None = None
    estimate: float | None = None
    ci95: list[float] = field(default_factory=list)
    unit: str = "1"
    bound: str | None = None
    sharper: str


@dataclass(frozen=True, kw_only=True)
class EvidenceParts:
    """Where a ln BF comes from, which is their sum: `fit`, closer to the readings; `priors_relieved`, what healthy
    differences and other causes no longer have to do, by family in `relieved`, largest first; `rest`, what one more
    term costs by its own prior and by how much narrower or wider the numbers have become."""

    fit: float
    priors_relieved: float
    rest: float
    relieved: dict[str, float]


@dataclass(frozen=True, kw_only=True)
class Stands:
    """What a candidate is in the readings: its `amplitude`, in its unit at features of 1 (of a factor its logarithm),
    and how far that stands above what noise and calibration leave of it, `d` (size over sd by the readings alone)."""

    amplitude: float
    d: float


@dataclass(frozen=True, kw_only=True)
class Named:
    """A cause that entered by evidence and survived being left out. `estimate`, `ci95` in `unit`; `typical_W` at the
    mean of the training sessions (None where the cause is no heat); `largest_effect_K` on the modelled
    `largest_effect_node`, in session `largest_effect_session` at `largest_effect_t_s`; `formula` of the term as the
    extended file has it; `times_usual`: its size over the prior sd of such a cause; `evidence`: where its ln BF comes
    from (None for a fault of the data); `sayable`: a motor or bench file can have it, unlike a change from session to
    session or a fault of the record."""

    id: str
    says: str
    members: list[str]
    estimate: float
    ci95: list[float]
    unit: str
    typical_W: float | None
    largest_effect_K: float
    largest_effect_node: str
    largest_effect_session: str
    largest_effect_t_s: float
    formula: str
    log_bayes_factor: float
    probability: float
    member_probability: float
    indistinguishable_from: list[str]
    separating_test: str | None
    significant: bool
    identified: bool
    improved: bool
    why_not_improved: str | None
    times_usual: float = 1.0
    evidence: EvidenceParts | None = field(default=None, metadata=IF_SAID)
    stands: Stands | None = field(default=None, metadata=IF_SAID)
    sayable: bool = True

    @property
    def of_the_record(self) -> bool:
        """Whether it is a fault of the record: samples that were left out before anything was fitted."""
        return not self.sayable and self.evidence is None


@dataclass(frozen=True, kw_only=True)
class Rival:
    """A candidate that was not named, and why."""

    id: str
    says: str
    log_bayes_factor: float
    why_not: str
    evidence: EvidenceParts | None = field(default=None, metadata=IF_SAID)
    stands: Stands | None = field(default=None, metadata=IF_SAID)


@dataclass(frozen=True, kw_only=True)
class HeatOverLoad:
    """A heat [W] over speed and load, beside what it is most of the time: a row of `watts` and of `seconds` (how long
    the sessions were near) for each of `speed_rpm`, in it one for each of `torque_Nm`, negative while the motor brakes,
    or, where no torque is recorded, of `current_A`."""

    speed_rpm: list[float]
    torque_Nm: list[float] = field(default_factory=list, metadata=IF_SAID)
    current_A: list[float] = field(default_factory=list, metadata=IF_SAID)
    watts: list[list[float]]
    seconds: list[list[float]]


@dataclass(frozen=True, kw_only=True)
class UnnamedHeat:
    """A heat at a node that no candidate explains: its range [W] (cooling negative) while it is active, the range of
    each input and temperature then (name with unit -> [from, to]), and what it goes with, strongest first. `patchwork`:
    candidates that fit only together, each no name of what is there; the range [W] is then that of a heat which changes
    slowly. `map`: of one that goes with speed and load in a way that no law has. `fitted`: the sessions were fitted
    once more with this map, which the extended motor file says as a term of the id `extends`, where it can; `improved`
    as of a named cause."""

    node: str
    watts: list[float]
    when: dict[str, list[float]]
    goes_with: list[str]
    log_bayes_factor: float
    patchwork: list[str] = field(default_factory=list)
    map: HeatOverLoad | None = field(default=None, metadata=IF_SAID)
    fitted: bool = field(default=False, metadata=IF_SAID)
    extends: str | None = field(default=None, metadata=IF_SAID)
    improved: bool = field(default=False, metadata=IF_SAID)
    why_not_improved: str | None = field(default=None, metadata=IF_SAID)


@dataclass(frozen=True, kw_only=True)
class KeptGain:
    """Mean absolute error at a node over the kept sessions [K]: recalibrated without the causes, with them, as
    published. `ci95_K`: of the difference; `outside_trained_share`: of kept time in speed-current cells that training
    never visited. `rms_inside_K`, `rms_outside_K`: root mean square error without and with the causes, in cells that
    training visited and in the others; empty where no kept time was there."""

    node: str
    mae_before_K: float
    mae_after_K: float
    ci95_K: list[float]
    interval: str
    published_mae_K: float
    outside_trained_share: float
    rms_inside_K: list[float] = field(default_factory=list)
    rms_outside_K: list[float] = field(default_factory=list)
    mae_recorded_K: dict[str, float] = field(default_factory=dict)
    reading_moved_K: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Relieved:
    """A healthy difference, in words, that had to stand in for the cause: how far it moves in the recalibrated and in
    the extended model, in its prior sd."""

    parameter: str
    before_sd: float
    after_sd: float


@dataclass(frozen=True, kw_only=True)
class UnseenNode:
    """How far apart the two models are at a node without a sensor [K], in the mean over the sessions and at most, that
    in `session` at `t_s`."""

    node: str
    mean_K: float
    max_K: float
    session: str
    t_s: float


@dataclass(frozen=True, kw_only=True)
class SteadyPoint:
    """An hour at a constant point, `at`: quantity with unit -> value; the node that is furthest apart at its end, by
    the extended less the recalibrated model [K]."""

    says: str
    at: dict[str, float]
    node: str
    differ_K: float


@dataclass(frozen=True, kw_only=True)
class Telling:
    """What would tell which model is right: the test `says` ("" for more of the same sessions), and the `channel` that
    shows it, or None for a sensor at `node` that is not there. `times_sensor`: over what such a sensor may be off."""

    says: str
    node: str
    channel: str | None
    differ_K: float
    times_sensor: float


@dataclass(frozen=True, kw_only=True)
class TwoModels:
    """Recalibrated alone or with what was named: `relieved` of what had to stand in for it, most relieved first; nodes
    without a sensor (`inside`), furthest apart first, `over_kept` sessions or else over those learnt from; operating
    `points`; and the `test` and the `sensor` that would tell, None where none does."""

    over_kept: bool
    relieved: list[Relieved]
    inside: list[UnseenNode]
    points: list[SteadyPoint]
    test: Telling | None
    sensor: Telling | None


@dataclass(frozen=True, kw_only=True)
class LawCourse:
    """What a named cause changes at its `place`, over speed at the usual load (`at`: quantity with unit -> value): the
    whole heat [W] or conductance [W/K] there, of several members their sum, without what temperature changes.
    `published`, `recalibrated`, `extended` and each of `rivals` (id -> values) in its own fit; `low`, `high`: 95 % band
    of the extended one by the size of the cause; `trained_rpm`: ranges of speed that the sessions learnt from visited.
    All lists are as long as `speed_rpm`."""

    cause: str
    place: str
    unit: str
    at: dict[str, float]
    speed_rpm: list[float]
    published: list[float]
    recalibrated: list[float]
    extended: list[float]
    low: list[float]
    high: list[float]
    rivals: dict[str, list[float]]
    trained_rpm: list[list[float]]


@dataclass(frozen=True, kw_only=True)
class ForeseenTest:
    """What the next test, `says`, would show: the reading of the `channel` that tells most [degC] at `t_s` by each
    model: "recalibrated" without a cause, or a cause's id. `floor_K`: what the sensor may be off."""

    says: str
    channel: str
    node: str
    floor_K: float
    t_s: list[float]
    reads: dict[str, list[float]]


@dataclass(frozen=True, kw_only=True)
class Masked:
    """A data fault found before calibration and left out: a held, stuck, saturated or dead stretch of a channel."""

    session: str
    session_name: str
    channel: str
    says: str


@dataclass(frozen=True, kw_only=True)
class Contradicting:
    """Two sessions that ran alike up to the moments `t_s` and were read differently: `channel` reads `differ_K` more in
    the first, where two such moments differ by `sd_K` (standard deviation). `at`: the inputs at which both had settled
    (quantity with unit -> value); empty where they ran alike from their first move on instead."""

    sessions: list[str]
    t_s: list[float]
    at: dict[str, float]
    channel: str
    node: str
    differ_K: float
    sd_K: float


@dataclass(frozen=True, kw_only=True)
class ChainStep:
    """What one more term brought. `step` -1: the file as published, 0: recalibrated alone (`id` None of both), then the
    terms in the order of entry; `told_together`: what these sessions cannot tell it from. Of each training session
    predicted from the others, `left_out_mae_K`: node -> mean error, and how many of the `sessions` got better than in
    the step before (`sessions_better`); as published nothing is learnt, so nothing is left out. `kept_mae_K`: node ->
    mean error of the kept sessions, replayed against readings as recorded; empty where a replay runs away. `model` and
    `bench`: the files of the step (None where there are none or they do not change), `benches`: each bench file as it
    was -> its version."""

    step: int
    id: str | None
    told_together: list[str]
    formula: str
    log_bayes_factor: float | None
    sessions_better: int
    sessions: int
    left_out_mae_K: dict[str, float]
    kept_mae_K: dict[str, float]
    model: str | None
    bench: str | None
    benches: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Diagnosis:
    """The whole answer. Models are ids: `model` as published, `recalibrated_model` without a new term (None where it is
    worse on the kept sessions than the file as published), `extended_model` with the named causes or the map of an
    unknown heat, improved or not (None where nothing is to be added, or a replay with it runs away);
    `recalibrated_benches` and `extended_benches` (bench file -> its version) go with them, of those that change, and
    `recalibrated_bench` and `extended_bench` are the first of these (None without any).

    `candidates` tried, `steps` simulated once over training, `null_log_bayes_factor` the 95 % quantile of the best of
    them on data that hold none, `threshold` what a term must exceed; `log_score_gain` of kept sessions with its lower
    bound.
    """

    diagnosis: str
    motor: str
    level: str
    model: str
    train: list[str]
    held_out: list[str]
    train_names: list[str]
    held_out_names: list[str]
    opened_before: bool  # the kept sessions were opened by an earlier diagnosis
    shown: list[Shown]
    causes: list[Named]
    rivals: list[Rival]
    unknown: list[UnnamedHeat]
    masked: list[Masked]
    recalibrated_model: str | None
    extended_model: str | None
    extended_bench: str | None
    gain: list[KeptGain]
    log_score_gain: float | None
    log_score_gain_lower: float | None
    few_kept_data: bool
    candidates: int
    dropped: list[str]  # candidates that made the model unstable
    steps: int
    null_log_bayes_factor: float
    threshold: float
    next_test: str | None
    recalibrated_bench: str | None = None
    recalibrated_benches: dict[str, str] = field(default_factory=dict)
    extended_benches: dict[str, str] = field(default_factory=dict)
    why_no_files: str | None = None  # what a file could not say or a replay not stand, where that left files away
    findings: list[Unusual] = field(default_factory=list)  # what is unusual before any cause, the strongest first
    contradicting: list[Contradicting] = field(default_factory=list)  # sessions learnt from, the worst first
    two_models: TwoModels | None = None  # where something was named that a file can say
    chain: list[ChainStep] = field(default_factory=list)  # none where channels are exchanged
    laws: list[LawCourse] = field(default_factory=list)  # of named heats and heat paths
    foreseen: ForeseenTest | None = None  # where there is a next test
    judged_by: str = "evidence"  # or "sessions left out", or "few sessions", which let in one term alone
    crudeness: float | None = None  # times as far as usual that numbers moved, where a name says so little

    @property
    def offers(self) -> bool:
        """Whether there are extended files."""
        return self.extended_model is not None or self.extended_bench is not None

    @property
    def fitted_with(self) -> list[Named]:
        """The causes with which the sessions were fitted once more."""
        return [cause for cause in self.causes if not cause.of_the_record]

    @property
    def learnt(self) -> bool:
        """Whether the sessions were fitted once more, with causes or with an unknown heat."""
        return bool(self.fitted_with) or any(heat.fitted for heat in self.unknown)

    @property
    def improved(self) -> bool:
        """Whether kept sessions are predicted better with one of what was learnt."""
        return any(c.improved for c in self.causes) or any(h.improved for h in self.unknown)

    @property
    def said(self) -> list[str]:
        """Ids of what the extended files say."""
        return [*(c.id for c in self.causes if c.sayable), *(h.extends for h in self.unknown if h.extends)]


def calibration_is_worse(gain: Sequence[KeptGain]) -> bool:
    """Whether the recalibrated model is further off on the kept sessions than the file as published, in the mean over
    the nodes."""
    return sum(one.mae_before_K for one in gain) > sum(one.published_mae_K for one in gain)


def document(diagnosis: Diagnosis, provenance: dict[str, Any]) -> dict[str, Any]:
    """The JSON answer."""
    return {"schema": SCHEMA, **to_json(diagnosis), "provenance": provenance}


def read(document: dict[str, Any]) -> Diagnosis:
    """The diagnosis of a document that `document` wrote."""
    found: Diagnosis = from_json(Diagnosis, document)
    return found
