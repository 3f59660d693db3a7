"""Columns of a table that a bench file names with another unit: they would stand unnamed beside a channel without
samples, as after somebody has set a logger to degF."""

from __future__ import annotations

import re

from ingest.facts.events import DecodeCompleted, QualityFlagged
from ingest.texts.guessing import words
from ingest.texts.names import first_of
from ingest.texts.units import normal_unit

FLAG = "other_unit"
SHOWN = 5  # columns


def findings(name: str, decode: DecodeCompleted) -> list[QualityFlagged]:
    """A flag of the file `name` where it holds a column that no channel names, but for the unit in brackets."""
    unnamed = {bare: c["name"] for c in decode.channels if not c["quantity"] and (bare := _bare(c["name"]))}
    missing = ((one, _bare(one)) for one in decode.settings.get("missing", ()))
    names = [f"{unnamed[bare]} and not {one}" for one, bare in missing if bare in unnamed]
    if not names:
        return []
    says = f"{name}: holds {first_of(names, SHOWN)} of the bench file: give what it holds a [[channel]] too"
    return [QualityFlagged(flag=FLAG, says=says, detail={"file": name})]


def _bare(column: str) -> str | None:
    """A column's name without the unit in brackets at its end; None without one."""
    found = re.fullmatch(r"(.*\S)\s*[\[(]([^\[\]()]+)[\])]", column)
    return words(found[1]) if found and normal_unit(found[2]) else None
