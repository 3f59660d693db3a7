"""What `whyhot lineage` answers: from a number down to the bytes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from ingest.texts.times import clock
from replay.show.words.terminal import labelled
from replay.show.words.words import signed_kelvin

if TYPE_CHECKING:
    from ingest.facts.lineage import FactLink
    from replay.studies.lineage.trace import Lineage, TracedPoint, TracedRecord


def lineage_json(found: Lineage) -> dict[str, Any]:
    return {
        "points": [vars(one) for one in found.points],
        "links": [vars(one) for one in found.links],
        "records": [
            {"file_id": one.file, "name": one.name, **vars(one.found), "absolute": one.absolute}
            for one in found.records
        ],
    }


def lineage_text(found: Lineage) -> str:
    """The point, the facts behind it, the records."""
    lines: list[str] = []
    for point in found.points:
        lines += labelled("Point", _point(point))
    for link in found.links:
        lines += _link(link)
    for record in found.records:
        lines += _record(record)
    return "\n".join(lines)


def _point(one: TracedPoint) -> str:
    where = f"{one.channel} ({one.node})"
    if one.steps > 1:
        return (
            f"{where}: mean error {one.residual_K:.4g} K over {one.steps:,} steps that were used; in the mean measured "
            f"{one.measured:.2f} °C, modelled {one.modelled:.2f} °C; records {one.first:,} to {one.last:,}"
        )
    used = "" if one.used else "; not used"
    return (
        f"{where} at {clock(one.t_s)}: measured {one.measured:.2f} °C, modelled {one.modelled:.2f} °C, "
        f"{signed_kelvin(one.residual_K)}{used}; records {one.first:,} to {one.last:,}"
    )


def _link(link: FactLink) -> Iterator[str]:
    yield from labelled(link.kind.capitalize(), f"{link.says}; {link.id}")
    if link.event is not None:
        when = f"event {link.event}, {str(link.recorded)[:19].replace('T', ' ')}, {link.code}"
        yield from labelled("", f"{when}: {link.command}" if link.command else when)


def _record(one: TracedRecord) -> list[str]:
    where = f", {one.found.where}" if one.found.where else ""
    stamp = one.found.stamp(one.absolute)
    return labelled(f"Record {one.found.record:,}", f"{one.name}{where}; {stamp}; {one.found.holds}")
