"""The bench file: what each signal of a log means (INTERFACES section 3)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from ingest.formats import TimeSpec


@dataclass(frozen=True)
class Channel:
    """One `[[channel]]` or `[[derived]]`. Numbers are in the *stored* unit of the quantity (quantities.STORED_UNIT).

    Exactly one of `signal` (a name in the log) and `expression` (with `name`) is given. `node` is a node or a boundary of
    the motor file; `weights` a weighted mean of nodes.
    """

    name: str  # the signal's bare name, or the derived channel's
    quantity: str
    unit: str  # in the file
    signal: str | None = None
    expression: str | None = None
    node: str | None = None
    weights: Mapping[str, float] = field(default_factory=dict)
    region: str | None = None
    level: str = "testing"
    noise: float | None = None
    bias_sd: float | None = None
    resolution: float | None = None
    time_constant_s: float = 0.0
    sensor: str | None = None
    card: str | None = None
    convention: str = "rms"
    role: str | None = None  # observed | input | ignored; None = by rule
    line: int = 0  # of the bench file, for messages


@dataclass(frozen=True)
class Bench:
    """A bench file, read and checked. `sha256` of its bytes is its identity."""

    sha256: str
    name: str  # file name
    motor: str | None = None  # as written, relative to the bench file's folder
    specimen: str | None = None
    specimen_column: str | None = None
    batch: str | None = None
    batch_column: str | None = None
    kind: str | None = None
    configuration: str | None = None
    attributes: Mapping[str, str] = field(default_factory=dict)
    time: TimeSpec = field(default_factory=TimeSpec)
    join_gap_s: float = 60.0
    channels: tuple[Channel, ...] = ()
