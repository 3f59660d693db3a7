"""Facts: every event of the ledger, in the past tense. Names are stored for ever: add, never rename.

Payload fields are JSON values (str, int, float, bool, None, list, dict); nanoseconds are integers. Each event's text
begins with its stream, named `kind-key`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar, dataclass_transform

Json = dict[str, Any]
OfModel = dict[str, dict[str, str] | str]  # model -> bench file -> its version
SAME_NAME = "same_name_other_bytes"  # a flag of a file
COUNTS = ("decoded", "unknown_id", "wrong_length", "rejected")  # what becomes of a record


@dataclass_transform(frozen_default=True, kw_only_default=True, field_specifiers=(field,))
class Event:
    """Base of all facts, frozen dataclasses. `TOPIC`: the stored name, of the class's; `VERSION`: of its fields.

    A field that is added has a default. Any other change of the fields is a new version, and `EARLIER` says for each
    version before it what it is in the next one. What is stored stays as it is.
    """

    TOPIC: ClassVar[str]
    VERSION: ClassVar[int] = 1
    EARLIER: ClassVar[Mapping[int, Callable[[dict[str, Any]], dict[str, Any]]]] = {}

    def __init_subclass__(cls) -> None:
        cls.TOPIC = f"whyhot:{cls.__name__}"
        dataclass(frozen=True, kw_only=True)(cls)


class RawFileSealed(Event):
    """`file-<sha256>`: a log's bytes lie in the archive under their SHA-256."""

    sha256: str
    name: str
    size: int  # bytes
    format: str | None  # name in ingest.formats.FORMATS; None where no format claims it


class SignalDatabaseRegistered(Event):
    """`database-<sha256>`: a signal database lies in the archive."""

    sha256: str
    name: str


class BenchRegistered(Event):
    """`bench-<sha256>`: a bench file lies in the archive; `model` is the motor file it named, as it was then."""

    sha256: str
    name: str
    motor: str | None  # name in the motor file
    model: str | None  # SHA-256 of the motor file = model id


class MotorRegistered(Event):
    """`motor-<name>`: a motor is known from here on."""

    name: str


class ModelPublished(Event):
    """`motor-<name>`: a motor file lies in the archive; `model` = its SHA-256; `parent` the model it extends."""

    model: str
    motor: str
    file: str  # its name when it was sealed
    parent: str | None


class DecodeCompleted(Event):
    """`file-<sha256>`: what became of every record of a log, under one bench file, its motor file and its databases.

    `balance`: found = the sum of `COUNTS`. `groups`: [{name, file, rows, columns}];
    `channels`: [{name, group, column, quantity, unit, node, region, role, derived}]; `sources`: [{record, where,
    why}] of the first rejected records; `products`: file under `decoded/<decode>/` -> SHA-256; `parts` as
    `ingest.facts.sessions.parts` gives them, where a table holds many specimens.
    """

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
    parts: list[dict[str, Any]] = field(default_factory=list)
    model: str | None = None  # SHA-256 of the motor file that the bench file named then


class SessionRecorded(Event):
    """`session-<id>`: these files are one test. `files`: [{raw, decode, first_record, last_record}], of the checks of a
    table with the `rows` between these that are of this specimen."""

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


class SessionRegrouped(Event):
    """`session-<old id>`: a late file joined; the old id stays resolvable and points to `into`."""

    session: str
    into: str
    why: str


class QualityFlagged(Event):
    """`session-<id>` or `file-<sha256>`: something a person should look at, found at ingest."""

    flag: str  # same_name_other_bytes | overlap | held | stuck | gap | sheets_unread | several_specimens ...
    says: str
    detail: dict[str, Any] = field(default_factory=dict)


class ClockAligned(Event):
    """`session-<id>`: the stamps of `clock` (a logger, a bus or the stem of a table's name) are late by `offset_s`
    against those of `reference` at `at_ns`, and by `drift_ppm` more as time goes by; `by`: the channels that tell it,
    of the reference first. Said, not applied: a `[[correction]]` of a bench file moves stamps."""

    session: str
    clock: str
    reference: str
    by: list[str]
    at_ns: int
    offset_s: float
    offset_sd_s: float
    drift_ppm: float
    drift_sd_ppm: float
    correlation: float
    says: str


class ReplayCompleted(Event):
    """`run-<id>`: a sealed run. `artefacts`: {frame, temperatures, heat, residuals, meters, filtered} -> SHA-256 of
    Parquet; `filtered` where a filter ran. `summary`: its entry of `replay --json`, mae_K, max_K and bias_K by node and
    channels with `where`."""

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
    summary: dict[str, Any]


class ReplayDiverged(Event):
    """`run-<id>`: same key and environment, other digest."""

    run: str
    digest: str
    expected: str
    t_s: float | None
    field: str | None


class CalibrationCompleted(Event):
    """`calibration-<id>`: a motor's coefficients estimated from sessions; `model` is the motor file that holds them.

    `parameters`: [{name, unit, before, value, log_change, sd, prior_sd, held}], sd of the logarithm; `errors`:
    [{session, session_name, channel, node, before_K, after_K, bias_K, bias_sd_K}]: mean absolute errors of runs with
    the one and the other model, and what the channel is taken to read too much in that session; `covariance` of all
    parameters' logarithms (Parquet), None of calibrations that did not keep it.
    """

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


class HeldOutOpened(Event):
    """`diagnosis-<id>`: sessions kept from learning were looked at: whoever measures on them later has seen them."""

    diagnosis: str
    sessions: list[str]  # ids


class CauseNamed(Event):
    """`diagnosis-<id>`: a cause entered by evidence and survived being left out. `cause`: its id; `estimate` in `unit`;
    `probability` of what the data cannot tell from it together."""

    diagnosis: str
    cause: str
    estimate: float
    unit: str
    log_bayes_factor: float
    probability: float


class ModelExtended(Event):
    """`diagnosis-<id>`: a motor or bench file with the named causes lies in the archive: `model` extends `parent`,
    `bench` extends `parent_bench`, with which the diagnosis began; None where nothing was to be added."""

    diagnosis: str
    parent: str | None  # SHA-256 of motor files
    model: str | None
    parent_bench: str | None  # SHA-256 of bench files
    bench: str | None


class GainMeasured(Event):
    """`diagnosis-<id>`: what the causes gain on the kept sessions. `gain`: [{node, mae_before_K, mae_after_K, ci95_K,
    interval, published_mae_K, mae_recorded_K: {published, before, after}, reading_moved_K, outside_trained_share,
    rms_inside_K, rms_outside_K}]."""

    diagnosis: str
    gain: list[dict[str, Any]]


class DiagnosisCompleted(Event):
    """`diagnosis-<id>`: a diagnosis is sealed. `artefact`: SHA-256 of its document (JSON, `whyhot.diagnosis/1`);
    `files`: of the motor and bench files that it tried on the kept sessions and does not offer."""

    diagnosis: str  # = hash of `key`
    key: Annotated[Json, {"train": list[str], "kept": list[str], "benches": list[str], "model": str, "code": str}]
    artefact: str
    summary: Annotated[Json, {"motor": str, "causes": list[str], "benches": Annotated[Json, {"of_model": OfModel}]}]
    files: list[str] = field(default_factory=list)


class CauseAccepted(Event):
    """`diagnosis-<id>`: a person took its causes: from here on `model` is current in place of `parent`, and
    `bench` in place of `parent_bench`; None where there is nothing of the kind."""

    diagnosis: str
    causes: list[str]  # ids
    parent: str | None  # SHA-256 of motor files
    model: str | None
    parent_bench: str | None  # SHA-256 of bench files
    bench: str | None


class InspectionRecorded(Event):
    """`inspection-<id>`: a person looked at a specimen and found something; the file that shows it lies in the archive.

    The same bytes with another finding, specimen, time or session are another inspection.
    """

    inspection: str  # = hash of all that is below but name and media type
    sha256: str
    name: str
    media_type: str
    size: int  # bytes
    specimen: str
    happened: str | None  # ISO 8601 UTC, as it was said; None where only the session, or nothing, is known
    session: str | None  # id of the session that it followed, as it was then
    finding: str


class AgeingAssessed(Event):
    """`ageing-<id>`: the insulation of specimens was assessed from these sessions. `answer`: SHA-256 of its document
    (JSON, `whyhot.ageing/1`); `artefacts`: {checks, specimens, batches} -> SHA-256 of its tables (Parquet). Of a fleet
    `sessions` are the first of `count`: its table of checks holds all of them."""

    assessment: str  # = hash of `key`
    key: dict[str, Any]
    answer: str
    artefacts: dict[str, str]
    sessions: list[str]  # ids
    digest: str
    count: int | None = None  # of the sessions; None: `sessions` are all


class FactRetracted(Event):
    """The stream of what it takes back (a log, session, diagnosis or inspection): from here on that does not count.

    `rows`: [{raw, first_record, last_record}], what of which logs goes with it; `models`: those that it had published.
    """

    fact: str  # the stream
    name: str  # as people call it: 3_wltp.blf, d-4f0c12ab34cd
    why: str
    rows: list[dict[str, Any]] = field(default_factory=list)
    models: list[str] = field(default_factory=list)  # SHA-256 of motor files


class FactReinstated(Event):
    """The stream of what was taken back: from here on it counts again, as if that had not been."""

    fact: str  # the stream
    why: str


class LogForgotten(Event):
    """`file-<sha256>`: a log that was taken back had to go for good. Its bytes and what was made of them are removed
    after this; the facts of it remain, and the same bytes are never taken in again."""

    raw: str
    name: str
    size: int  # bytes
    why: str


class LogCorrected(Event):
    """`file-<sha256>`: what was said of a log was wrong. `said`: {bench, motor, databases, specimen, batch or kind:
    [before, now]}, files by their SHA-256."""

    raw: str
    said: dict[str, list[Any]]
    why: str


class LedgerSealed(Event):
    """`ledger-0`: Merkle root over every stored column of all events up to `position`, the one before this."""

    position: int
    root: str


EVENTS: dict[str, type[Event]] = {kind.TOPIC: kind for kind in Event.__subclasses__()}  # the allow-list of topics
