"""What the catalogue knows of one session, as data: of the session, its files and its channels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from ingest.catalogue.operating_points import OperatingPoints
from ingest.catalogue.power import PowerBalance


@dataclass(frozen=True)
class Repeats:
    """The gaps of a channel, or its stretches of one kind: how many, the longest [s], all together [s]."""

    kind: str  # gap, held, stuck, saturated
    times: int
    longest_s: float
    total_s: float


@dataclass(frozen=True)
class ChannelDescription:
    """One channel; `low`, `high`, `noise` (one sigma), `resolution` as seen, in `unit`; None with too few samples."""

    name: str
    quantity: str | None
    unit: str | None
    node: str | None
    role: str
    samples: int
    rate_Hz: float | None
    low: float | None
    high: float | None
    noise: float | None
    resolution: float | None
    repeats: tuple[Repeats, ...]


@dataclass(frozen=True)
class SourceDescription:
    """One file of a session and what became of its records; the balance holds where found is the sum of `COUNTS`."""

    file: str
    sha256: str
    decode: str
    outcome: str
    why: str | None
    first_record: int
    last_record: int
    records: str  # which of its records, in words
    balance: Mapping[str, int]
    unknown_ids: Mapping[str, int]
    rejections: Sequence[Mapping[str, Any]]
    holds: bool  # the balance
    times: str | None  # what its stamps are: UTC, whose wall clock taken as which zone, or counted from a start


@dataclass(frozen=True)
class SessionDescription:
    """Everything that the catalogue knows of one session. `start` is ISO 8601 UTC, None without absolute time."""

    session: str
    name: str
    kind: str
    kind_why: str
    start: str | None
    duration_s: float
    specimen: str | None
    batch: str | None
    motor: str | None
    bench: str | None  # file name
    configuration: str | None
    attributes: Mapping[str, str]
    changes: tuple[str, ...]  # what the bench file says is other about channels by then, and since when
    sources: tuple[SourceDescription, ...]
    channels: tuple[ChannelDescription, ...]
    power: PowerBalance | None
    operating_points: OperatingPoints | None
    findings: tuple[str, ...]  # what a person should look at, one line each
    corrections: tuple[str, ...] = ()  # what the bench file says is wrong: taken off here, in replays and pictures

    def to_json(self) -> dict[str, Any]:
        """The answer of `show --json` (schema `whyhot.show/1`)."""
        return {"schema": "whyhot.show/1", **asdict(self)}
