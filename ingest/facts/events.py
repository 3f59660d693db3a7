"""Facts: every event of the ledger, in the past tense. Names are stored for ever: add, never rename.

Payload fields are JSON values (str, int, float, bool, None, list, dict); nanoseconds are integers. A stream is named
`kind-key`: `file-<sha256>`, `database-<sha256>`, `bench-<sha256>`, `motor-<name>`, `session-<id>`, `run-<id>`,
`calibration-<id>`, `diagnosis-<id>`, `inspection-<id>`, `ageing-<id>`, `ledger-0`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar


@dataclass(frozen=True, kw_only=True)
class Event:
    """Base of all facts. `VERSION` is the schema version of the payload."""

    TOPIC: ClassVar[str]
    VERSION: ClassVar[int] = 1


@dataclass(frozen=True, kw_only=True)
class RawFileSealed(Event):
    """`file-<sha256>`: a log's bytes lie in the archive under their SHA-256."""

    TOPIC: ClassVar[str] = "whyhot:RawFileSealed"
    sha256: str
    name: str
    size: int  # bytes
    format: str | None  # name in ingest.formats.FORMATS; None where no format claims it


@dataclass(frozen=True, kw_only=True)
class SignalDatabaseRegistered(Event):
    """`database-<sha256>`: a DBC lies in the archive."""

    TOPIC: ClassVar[str] = "whyhot:SignalDatabaseRegistered"
    sha256: str
    name: str


@dataclass(frozen=True, kw_only=True)
class BenchRegistered(Event):
    """`bench-<sha256>`: a bench file lies in the archive; `model` is the motor file it named, as it was then."""

    TOPIC: ClassVar[str] = "whyhot:BenchRegistered"
    sha256: str
    name: str
    motor: str | None  # name in the motor file
    model: str | None  # SHA-256 of the motor file = model id


@dataclass(frozen=True, kw_only=True)
class MotorRegistered(Event):
    """`motor-<name>`: a motor is known from here on."""

    TOPIC: ClassVar[str] = "whyhot:MotorRegistered"
    name: str


@dataclass(frozen=True, kw_only=True)
class ModelPublished(Event):
    """`motor-<name>`: a motor file lies in the archive; `model` = its SHA-256; `parent` the model it extends."""

    TOPIC: ClassVar[str] = "whyhot:ModelPublished"
    model: str
    motor: str
    file: str  # its name when it was sealed
    parent: str | None


@dataclass(frozen=True, kw_only=True)
class DecodeCompleted(Event):
    """`file-<sha256>`: what became of every record of a log, under one bench file, its motor file and its databases.

    `balance`: found = decoded + unknown_id + wrong_length + rejected. `groups`: [{name, file, rows, columns}];
    `channels`: [{name, group, column, quantity, unit, node, region, role, derived}]; `sources`: [{record, where,
    why}] of the first rejected records; `products`: file name -> SHA-256 of recording and Parquet, under
    `decoded/<decode>/`.
    """

    TOPIC: ClassVar[str] = "whyhot:DecodeCompleted"
    decode: str  # hash of raw, databases, bench, model, decoder version
    raw: str
    bench: str | None
    databases: list[str]
    decoder: str
    outcome: str  # decoded | salvaged | quarantined
    why: str | None  # where not decoded whole: the line that was printed
    absolute: bool
    start_ns: int | None
    end_ns: int | None
    balance: dict[str, int]
    unknown_ids: dict[str, int] = field(default_factory=dict)  # "can1:0x123" -> frames
    rejections: list[dict[str, Any]] = field(default_factory=list)
    settings: dict[str, Any] = field(default_factory=dict)
    groups: list[dict[str, Any]] = field(default_factory=list)
    channels: list[dict[str, Any]] = field(default_factory=list)
    products: dict[str, str] = field(default_factory=dict)
    # As `ingest.facts.sessions.parts`, where a table holds many specimens.
    parts: list[dict[str, Any]] = field(default_factory=list)
    model: str | None = None  # SHA-256 of the motor file that the bench file named then


@dataclass(frozen=True, kw_only=True)
class SessionRecorded(Event):
    """`session-<id>`: these files are one test. `files`: [{raw, decode, first_record, last_record}]."""

    TOPIC: ClassVar[str] = "whyhot:SessionRecorded"
    session: str
    name: str
    kind: str
    kind_why: str
    specimen: str | None
    batch: str | None
    bench: str | None
    configuration: str | None
    attributes: dict[str, str]
    absolute: bool
    start_ns: int
    end_ns: int
    files: list[dict[str, Any]]
    model: str | None = None  # SHA-256 of the motor file that the bench file named when these files came


@dataclass(frozen=True, kw_only=True)
class SessionRegrouped(Event):
    """`session-<old id>`: a late file joined; the old id stays resolvable and points to `into`."""

    TOPIC: ClassVar[str] = "whyhot:SessionRegrouped"
    session: str
    into: str
    why: str


@dataclass(frozen=True, kw_only=True)
class QualityFlagged(Event):
    """`session-<id>` or `file-<sha256>`: something a person should look at, found at ingest."""

    TOPIC: ClassVar[str] = "whyhot:QualityFlagged"
    flag: str  # same_name_other_bytes | overlap | held | stuck | saturated | gap
    says: str
    detail: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class ReplayCompleted(Event):
    """`run-<id>`: a sealed run. `artefacts`: {frame, temperatures, heat, residuals, meters, filtered} -> SHA-256 in
    the archive (Parquet); `filtered` where a filter ran."""

    TOPIC: ClassVar[str] = "whyhot:ReplayCompleted"
    run: str  # = hash of `key`
    session: str
    model: str
    motor: str
    level: str
    bench: str | None
    key: dict[str, Any]
    digest: str
    environment: dict[str, str]
    artefacts: dict[str, str]
    # The run's entry of `replay --json`: mae_K, max_K, bias_K by node, and channels with `where`.
    summary: dict[str, Any]


@dataclass(frozen=True, kw_only=True)
class ReplayDiverged(Event):
    """`run-<id>`: same key and environment, other digest."""

    TOPIC: ClassVar[str] = "whyhot:ReplayDiverged"
    run: str
    digest: str
    expected: str
    t_s: float | None
    field: str | None


@dataclass(frozen=True, kw_only=True)
class CalibrationCompleted(Event):
    """`calibration-<id>`: a motor's coefficients estimated from sessions; `model` is the motor file that holds them.

    `parameters`: [{name, unit, before, value, log_change, sd, prior_sd, held}], sd of the logarithm; `errors`:
    [{session, session_name, channel, node, before_K, after_K, bias_K, bias_sd_K}]: mean absolute errors of runs with
    the one and the other model, and what the channel is taken to read too much in that session; `covariance` of all
    parameters' logarithms (Parquet), None of calibrations that did not keep it.
    """

    TOPIC: ClassVar[str] = "whyhot:CalibrationCompleted"
    calibration: str  # = hash of `key`
    sessions: list[str]
    parent: str
    model: str
    motor: str
    level: str
    key: dict[str, Any]
    environment: dict[str, str]
    converged: bool
    iterations: int
    log_posterior: float
    parameters: list[dict[str, Any]]
    errors: list[dict[str, Any]]
    covariance: str | None = None  # SHA-256


@dataclass(frozen=True, kw_only=True)
class HeldOutOpened(Event):
    """`diagnosis-<id>`: sessions that were kept from learning were looked at; what is measured on them after this has
    been seen before."""

    TOPIC: ClassVar[str] = "whyhot:HeldOutOpened"
    diagnosis: str
    sessions: list[str]  # ids


@dataclass(frozen=True, kw_only=True)
class CauseNamed(Event):
    """`diagnosis-<id>`: a cause entered by evidence and survived being left out. `cause`: its id; `estimate` in `unit`;
    `probability` of what the data cannot tell from it together."""

    TOPIC: ClassVar[str] = "whyhot:CauseNamed"
    diagnosis: str
    cause: str
    estimate: float
    unit: str
    log_bayes_factor: float
    probability: float


@dataclass(frozen=True, kw_only=True)
class ModelExtended(Event):
    """`diagnosis-<id>`: a motor or bench file with the causes that improved lies in the archive. `model` extends
    `parent`, `bench` extends `parent_bench`, the versions that the diagnosis began from; None where nothing was to be
    added to it."""

    TOPIC: ClassVar[str] = "whyhot:ModelExtended"
    diagnosis: str
    parent: str | None  # SHA-256 of motor files
    model: str | None
    parent_bench: str | None  # SHA-256 of bench files
    bench: str | None


@dataclass(frozen=True, kw_only=True)
class GainMeasured(Event):
    """`diagnosis-<id>`: what the causes gain on the kept sessions. `gain`: [{node, mae_before_K, mae_after_K, ci95_K,
    interval, published_mae_K, outside_trained_share, rms_inside_K, rms_outside_K}]."""

    TOPIC: ClassVar[str] = "whyhot:GainMeasured"
    diagnosis: str
    gain: list[dict[str, Any]]


@dataclass(frozen=True, kw_only=True)
class DiagnosisCompleted(Event):
    """`diagnosis-<id>`: a diagnosis is sealed; `artefact` is the SHA-256 of its document (JSON,
    `whyhot.diagnosis/1`)."""

    TOPIC: ClassVar[str] = "whyhot:DiagnosisCompleted"
    diagnosis: str  # = hash of `key`
    key: dict[str, Any]
    artefact: str
    summary: dict[str, Any]


@dataclass(frozen=True, kw_only=True)
class CauseAccepted(Event):
    """`diagnosis-<id>`: a person took its improved causes: from here on `model` is current in place of `parent`, and
    `bench` in place of `parent_bench`; None where there is nothing of the kind."""

    TOPIC: ClassVar[str] = "whyhot:CauseAccepted"
    diagnosis: str
    causes: list[str]  # ids
    parent: str | None  # SHA-256 of motor files
    model: str | None
    parent_bench: str | None  # SHA-256 of bench files
    bench: str | None


@dataclass(frozen=True, kw_only=True)
class InspectionRecorded(Event):
    """`inspection-<id>`: a person looked at a specimen and found something; the file that shows it lies in the archive.

    The same bytes with another finding, specimen, time or session are another inspection.
    """

    TOPIC: ClassVar[str] = "whyhot:InspectionRecorded"
    inspection: str  # = hash of all that is below but name and media type
    sha256: str
    name: str
    media_type: str
    size: int  # bytes
    specimen: str
    happened: str | None  # ISO 8601 UTC, as it was said; None where only the session, or nothing, is known
    session: str | None  # id of the session that it followed, as it was then
    finding: str


@dataclass(frozen=True, kw_only=True)
class AgeingAssessed(Event):
    """`ageing-<id>`: the insulation of specimens was assessed from these sessions. `answer` is the SHA-256 of its
    document (JSON, `whyhot.ageing/1`), `artefacts`: {checks, specimens, batches} -> SHA-256 of its tables in the
    archive (Parquet)."""

    TOPIC: ClassVar[str] = "whyhot:AgeingAssessed"
    assessment: str  # = hash of `key`
    key: dict[str, Any]
    answer: str
    artefacts: dict[str, str]
    sessions: list[str]  # ids
    digest: str


@dataclass(frozen=True, kw_only=True)
class LedgerSealed(Event):
    """`ledger-0`: Merkle root over every stored column of all events up to `position`, the one before this."""

    TOPIC: ClassVar[str] = "whyhot:LedgerSealed"
    position: int
    root: str


def _all_events(base: type[Event] = Event) -> dict[str, type[Event]]:
    return {cls.TOPIC: cls for cls in base.__subclasses__()}


EVENTS: dict[str, type[Event]] = _all_events()  # the allow-list of topics
