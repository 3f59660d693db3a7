"""What a bench drives the model with, and by which bus each is stamped."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class InputChannel:
    """What drives the model: a quantity such as `speed`, `current`, `flow`, or a boundary's name; and the bus that
    stamps it."""

    name: str
    bus: str
