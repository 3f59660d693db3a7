"""What differs between two versions of a motor or bench file."""

from __future__ import annotations

from difflib import unified_diff


def changes(before: bytes, after: bytes) -> list[str]:
    """Lines that went ("- ...") and came ("+ ..."), in the order of the file."""
    old, new = (data.decode(errors="replace").splitlines() for data in (before, after))
    lines = [line for line in unified_diff(old, new, n=0, lineterm="") if not line.startswith("@@")]
    return [f"{line[0]} {line[1:]}".rstrip() for line in lines[2:]]
