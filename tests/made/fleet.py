"""A store of several motors with a diagnosis of one of them, as tests hand it on."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Fleet:
    """The store, and the id of the diagnosis in it."""

    store: Path
    diagnosis: str
