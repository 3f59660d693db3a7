"""What each way to a resistance gives: its value, and how sure that is."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ResistanceEstimate:
    """A resistance and its standard deviation [K/W]."""

    value: float
    sd: float
