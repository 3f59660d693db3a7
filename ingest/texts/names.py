"""Names that must differ, ids that are called by their beginning, and lists of many."""

from __future__ import annotations

from collections.abc import Sequence


def handle(key: str) -> str:
    """What an id or hash is called by where people read it and type it again."""
    return key[:12]


def is_called(key: str, text: str) -> bool:
    """Whether a text is an id, or a beginning of it that nobody types by chance."""
    return len(text) >= 4 and key.startswith(text.lower())


def first_of(names: Sequence[str], most: int, between: str = ", ") -> str:
    """The first `most` names, and how many more there are.

    >>> first_of(["a", "b", "c", "d"], 2)
    'a, b and 2 more'
    """
    more = f" and {len(names) - most:,} more" if len(names) > most else ""
    return f"{between.join(names[:most])}{more}"


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
