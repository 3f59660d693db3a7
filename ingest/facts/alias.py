"""A folder by a name that every library takes: DuckDB reads `?`, `*`, `[`, `"` and backslashes in a path as something
else, and neither it nor Arrow knows names that are no UTF-8."""

from __future__ import annotations

import atexit
import os
import re
import shutil
import tempfile
from pathlib import Path

MISREAD = re.compile(r'[?*\[\]{}\\"\ud800-\udfff]')


def is_misread(folder: Path) -> bool:
    """Whether DuckDB or Arrow takes the absolute path of `folder` for another one, or for none."""
    return os.name != "nt" and MISREAD.search(str(folder.absolute())) is not None


def reachable(folder: Path) -> Path:
    """`folder`, or a link to it that lasts as long as this process. Raises OSError where none can be made."""
    if not is_misread(folder):
        return folder.absolute() if str(folder).startswith("~") else folder  # Arrow takes it for a home
    place = Path(tempfile.mkdtemp(prefix="whyhot-"))
    atexit.register(shutil.rmtree, place, ignore_errors=True)
    link = place / "store"
    link.symlink_to(folder.absolute(), target_is_directory=True)
    return link
