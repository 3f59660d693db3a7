"""Examples that come with the program: in a checkout its `examples` folder, in an installed wheel a copy of it."""

from __future__ import annotations

from pathlib import Path

from replay.errors import ReplayDataError

PACKAGE = Path(__file__).parent


def example(name: str) -> Path:
    """The folder of a shipped example. Raises ReplayDataError where the installation lacks it."""
    for folder in (PACKAGE.parent / "examples" / name, PACKAGE / "examples" / name):
        if folder.is_dir():
            return folder
    raise ReplayDataError(f'example "{name}" did not come with this installation: install whyhot again.')
