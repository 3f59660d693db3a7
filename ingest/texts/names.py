"""Names that must differ."""

from __future__ import annotations

from collections.abc import Sequence


def each_once(names: Sequence[str]) -> tuple[str, ...]:
    """The names in their order, each once: a second `T` is called `T_2`, or by the next number that none has."""
    taken: dict[str, None] = {}
    for plain in names:
        name, count = plain, 1
        while name in taken or (count > 1 and name in names):
            count += 1
            name = f"{plain}_{count}"
        taken[name] = None
    return tuple(taken)
