"""Errors of the numerics: one class a condition; the message is one line with what, where, why and what to do."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Entry:
    """Where in a network: `table` (node, boundary, link, source, circuit, configuration, copper, scale), its `index`
    there, its `name`."""

    table: str
    index: int
    name: str

    def __str__(self) -> str:
        return f'{self.table} "{self.name}"'


class TwinError(Exception):
    """Root of everything that `twin` refuses. `str(error)` is the whole line that a person reads."""


class NetworkError(TwinError):
    """A network that cannot be a motor; `entry` says which entry, `says` what is wrong with it and what to do."""

    def __init__(self, entry: Entry, says: str) -> None:
        super().__init__(f"{entry}: {says}")
        self.entry = entry
        self.says = says


class BadNameError(NetworkError):
    """A name that is not `[a-z][a-z0-9_]*`."""


class DuplicateError(NetworkError):
    """Two entries of one name, or two links or sources at one place."""


class UnknownNodeError(NetworkError):
    """A link, source, circuit, configuration or factor names a node that is not there."""


class CutOffError(NetworkError):
    """A node from which no path of links and circuits leads to a boundary."""


class BadValueError(NetworkError):
    """A capacity, coefficient or slope that no motor can have."""


class FeatureError(NetworkError):
    """A feature that is not known, has no scale, or has an impossible exponent."""


class LinkError(NetworkError):
    """A link from a node to itself or between two boundaries, a link or source without terms, a circuit without
    nodes."""


class FactorError(NetworkError):
    """A factor or law that does not belong at its place, such as `copper` in a link."""


class ConfigurationError(TwinError):
    """A configuration that a network does not have."""


class FrameError(TwinError):
    """An input frame or start that does not fit the network, or is not finite."""


class DivergedError(TwinError):
    """A run left the finite numbers; the line names node and step."""


class CauseError(TwinError):
    """A text that is no cause id; the line says which part cannot be and what could stand there."""


class EvidenceError(TwinError):
    """Columns, residuals or priors that do not fit one another, or are not finite."""


class PlanError(TwinError):
    """No test can be planned from what was recorded."""
