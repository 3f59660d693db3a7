"""J1939: which message an identifier means whatever its priority and sender, and numbers that stand for no number.

The latter are described in SAE J1939-71.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ingest.facts.events import QualityFlagged
from ingest.formats import EXTENDED, Frames
from ingest.log.bits import Layout
from ingest.log.databases import Message
from ingest.log.parameter_groups import BROKEN, group_of, is_packet


@dataclass(frozen=True)
class Explained:
    """What identifiers mean. `decoded_as`: an identifier of a log -> the one in `messages` that it is decoded as, where
    that is another; `transport`: messages of several packets are put together; `on_bus`: (bus, identifier) -> what it
    means there, where that is another message."""

    messages: Mapping[int, Message]
    decoded_as: Mapping[int, int] = field(default_factory=dict)
    transport: bool = False
    on_bus: Mapping[tuple[int, int], Message] = field(default_factory=dict)

    def message(self, bus: int, can_id: int) -> Message:
        """What a known identifier means on a bus."""
        return self.on_bus.get((bus, can_id), self.messages[can_id])

    def knows(self, can_id: int) -> bool:
        """Whether frames with an identifier are explained, or put together to messages that may be."""
        return self.decoded_as.get(can_id, can_id) in self.messages or (self.transport and is_packet(can_id))

    def there(self, seen: Collection[tuple[int, int]]) -> set[tuple[int, int]]:
        """(bus, identifier) as they are decoded, of those in logs that mean a message."""
        found = {(bus, self.decoded_as.get(can_id, can_id)) for bus, can_id in seen}
        return {(bus, can_id) for bus, can_id in found if can_id in self.messages}

    def renamed(self, frames: Frames) -> Frames:
        """Frames under the identifiers that they are decoded as."""
        if not self.decoded_as:
            return frames
        known = np.array(sorted(self.decoded_as), np.uint32)
        names = np.array([self.decoded_as[one] for one in known.tolist()], np.uint32)
        at = np.minimum(np.searchsorted(known, frames.can_id), len(known) - 1)
        return replace(frames, can_id=np.where(known[at] == frames.can_id, names[at], frames.can_id))


def explained(
    messages: Mapping[int, Message], seen: Collection[int], on_bus: Mapping[tuple[int, int], Message] | None = None
) -> Explained:
    """What the identifiers `seen` in logs mean, by the messages of databases.

    A J1939 message is known by its group. Sent by several addresses, it is one message for each, with the address in
    its name (`EEC1_SA03`). An identifier that is in the databases as it stands, of no J1939 message, means just that.
    """
    by_group = {group_of(can_id): message for can_id, message in messages.items() if message.is_j1939}
    senders: defaultdict[int, defaultdict[int, list[int]]] = defaultdict(lambda: defaultdict(list))
    for can_id in sorted(seen):
        exact = messages.get(can_id)
        if can_id & int(EXTENDED) and group_of(can_id) in by_group and (exact is None or exact.is_j1939):
            senders[group_of(can_id)][can_id & 0xFF].append(can_id)
    found = {can_id: one for can_id, one in messages.items() if not one.is_j1939 or group_of(can_id) not in senders}
    decoded_as: dict[int, int] = {}
    for group, sources in senders.items():
        for source, ids in sources.items():
            name = by_group[group].name + (f"_SA{source:02X}" if len(sources) > 1 else "")
            found[ids[0]] = replace(by_group[group], name=name, can_id=ids[0])
            decoded_as |= dict.fromkeys(ids[1:], ids[0])
    return Explained(found, decoded_as, bool(by_group), on_bus or {})


def no_numbers(raw: NDArray[np.uint64], layout: Layout) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Which values (N,) of an unsigned signal say "error", and which "not available": by their first byte, 0xFE and
    0xFF; of a signal of fewer than 8 bits by all its bits."""
    if layout.signed or layout.is_float or layout.length < 2:
        none = np.zeros(len(raw), np.bool_)
        return none, none
    bits = min(layout.length, 8)
    first = raw >> np.uint64(layout.length - bits)
    return first == (1 << bits) - 2, first == (1 << bits) - 1


def findings(name: str, settings: Mapping[str, Any]) -> list[QualityFlagged]:
    """A flag of the file `name` for each thing that the settings of its decode say: values without a number, and
    messages of several packets that are not whole."""
    said = {"not_available": '"not available" in place of a number', "errors": '"error" in place of a number'}
    told = {flag: f"{_most(settings[flag])} {says}: missing" for flag, says in said.items() if flag in settings}
    if broken := settings.get("rejected", {}).get(BROKEN):
        told["packets_lost"] = f"{broken:,} frames: each a {BROKEN}"
    return [
        QualityFlagged(flag=flag, says=f"{name}: {says}", detail={"file": name, **settings.get(flag, {})})
        for flag, says in told.items()
    ]


def _most(counts: Mapping[str, int]) -> str:
    """ "12 values of EEC1.EngineSpeed and 3 more signals say"."""
    total, first = sum(counts.values()), max(counts, key=lambda signal: counts[signal])
    more = f" and {len(counts) - 1} more signals" if len(counts) > 1 else ""
    return f"{total:,} values of {first}{more} say"
