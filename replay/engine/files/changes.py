"""What differs between two versions of a motor or bench file."""

from __future__ import annotations

from collections.abc import Sequence
from difflib import SequenceMatcher


def changes(before: bytes, after: bytes) -> list[str]:
    """Lines that went ("- ...") and came ("+ ..."), in the order of the file; those of a table behind its first two
    lines, which say what it is of ('  [[node]] name = "rotor"')."""
    old, new = (data.decode(errors="replace").splitlines() for data in (before, after))
    of_old, of_new, told, lines = _tables(old), _tables(new), "", list[str]()
    for how, first, end, begin, stop in SequenceMatcher(None, old, new).get_opcodes():
        if how == "equal":
            continue
        went, came = old[first:end], new[begin:stop]
        table = of_old[first] if went else of_new[stop - 1]
        if table not in ("", told) and not any(line.startswith("[") for line in (*went, *came)):
            lines.append(f"  {table}")
        told = table
        lines += [f"- {line}".rstrip() for line in went] + [f"+ {line}".rstrip() for line in came]
    return lines


def _tables(lines: Sequence[str]) -> list[str]:
    """The first two lines of the table that each line stands in; "" before the first table."""
    found, table = list[str](), ""
    for k, line in enumerate(lines):
        if line.startswith("["):
            table = " ".join(lines[k : k + 2])
        found.append(table)
    return found
