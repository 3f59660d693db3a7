"""Messages of any shape as numbers by name: `pose.position.x`, `cells[3].voltage`."""

from __future__ import annotations

import json
from typing import Any

MOST_ELEMENTS = 64  # of a list that become columns: longer ones are pictures and clouds of points
DEEPEST = 20  # messages within each other

Numbers = dict[str, float | None]  # None: there is something that is no number


class NotRead(Exception):
    """A message cannot be read. `str` says why, as a clause."""


def decoded_json(data: bytes) -> Numbers:
    """The numbers of a JSON text. Raises NotRead."""
    found: Numbers = {}
    try:
        _add(found, "", json.loads(data), 0)
    except (ValueError, RecursionError) as error:
        raise NotRead(f"is no JSON ({str(error)[:80]})") from None
    return found


def _add(found: Numbers, name: str, value: Any, depth: int) -> None:
    if isinstance(value, dict) and depth < DEEPEST:
        for key, inner in value.items():
            _add(found, f"{name}.{key}" if name else str(key), inner, depth + 1)
    elif isinstance(value, list) and len(value) <= MOST_ELEMENTS and depth < DEEPEST:
        for i, inner in enumerate(value):
            _add(found, f"{name}[{i}]", inner, depth + 1)
    elif isinstance(value, int | float) and abs(value) < 1e308:
        found[name] = float(value)
    elif value is not None:
        found[name] = None
