"""The rooms of the house: every folder with an `__init__.py`, and what its docstring says."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

from made.places import ROOT

PACKAGES = ("twin", "ingest", "analytics", "replay")
_ORDER = re.compile(r"Rooms from the bottom up; each imports from those before it only: ([^.]*)\.")


def docstring(folder: Path) -> str:
    """Of a folder's `__init__.py`."""
    return ast.get_docstring(ast.parse((folder / "__init__.py").read_text(encoding="utf-8"))) or ""


def listed(folder: Path) -> tuple[str, ...]:
    """The rooms of a folder in the order that its docstring gives, from the bottom up; none where it gives none."""
    order = _ORDER.search(docstring(folder))
    return tuple(re.findall(r"`(\w+)`", order[1])) if order else ()


def below(folder: Path) -> Iterator[Path]:
    """The folders of a folder and of these: in the order of its docstring, else by name."""
    rooms = listed(folder) or sorted(path.parent.name for path in folder.glob("*/__init__.py"))
    for room in rooms:
        yield folder / room
        yield from below(folder / room)


def module_name(path: Path) -> str:
    """As a folder or file is imported: `twin.motor`, `twin.motor.network`."""
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


FOLDERS = [folder for package in PACKAGES for folder in (ROOT / package, *below(ROOT / package))]
ROOMS = {module_name(folder): listed(folder) for folder in FOLDERS if listed(folder)}
