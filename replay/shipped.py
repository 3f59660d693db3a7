"""Examples and notebooks that come with the program: in a checkout its own folders, in an installed wheel copies."""

from __future__ import annotations

from pathlib import Path

from replay.errors import ReplayDataError

PACKAGE = Path(__file__).parent


def example(name: str) -> Path:
    """The folder of a shipped example. Raises ReplayDataError where the installation lacks it."""
    return shipped(f"examples/{name}")


def shipped(place: str) -> Path:
    """A folder of what is shipped. Raises ReplayDataError where the installation lacks it."""
    for folder in (PACKAGE.parent / place, PACKAGE / place):
        if folder.is_dir():
            return folder
    raise ReplayDataError(f"{place} did not come with this installation: install whyhot again.")
