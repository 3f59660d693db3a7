"""Identifiers of J1939: priority (3 bits), parameter group (18), source address (8).

A group below 0xF000 is sent to one address, which stands in its last byte. Described in SAE J1939-21; in short:
https://www.csselectronics.com/pages/j1939-explained-simple-intro-tutorial
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ingest.formats import EXTENDED, REMOTE, Frames

TO_ALL = 0xFF
FIRST_BROADCAST = 0xF0  # second byte of a group that is sent to all
MANAGEMENT, DATA = 0xEC, 0xEB  # second byte of the groups of the transport protocol
BEGINS = (16, 32)  # first byte of its messages that announce one: to one address, and to all
LONGEST = 8  # bytes of its messages
BROKEN = "packet of a message that is not whole"
PRIORITY = 6 << 26  # of an identifier that no frame had


def group_of(can_id: int) -> int:
    """The parameter group of a 29-bit identifier, without the address that it is sent to."""
    group = can_id >> 8 & 0x3FFFF
    return group if group >> 8 & 0xFF >= FIRST_BROADCAST else group & ~0xFF


def is_packet(can_id: int) -> bool:
    """Whether frames with an identifier are the transport protocol's."""
    return can_id >= int(EXTENDED) and can_id >> 16 & 0xFF in (MANAGEMENT, DATA)


def identifier(group: int, source: int, target: int = TO_ALL) -> int:
    """An identifier of a group, as in `Frames`."""
    place = group if group >> 8 & 0xFF >= FIRST_BROADCAST else group & ~0xFF | target
    return int(EXTENDED) | PRIORITY | place << 8 | source


def announced_group(data: bytes) -> int:
    """The group of the message that 8 bytes of the transport protocol's management speak of."""
    return int.from_bytes(data[5:LONGEST], "little") & 0x3FFFF


def announced(frames: Frames) -> Iterator[tuple[int, int]]:
    """(bus, can_id) of each message of several packets that frames announce."""
    second = frames.can_id >> np.uint32(16) & np.uint32(0xFF)
    managing = (second == MANAGEMENT) & (frames.can_id >= EXTENDED) & (frames.flags & REMOTE == 0)
    for i in np.flatnonzero(managing).tolist():
        data = frames.data[frames.offsets[i] : frames.offsets[i + 1]].tobytes()
        if len(data) >= LONGEST and data[0] in BEGINS:
            can_id = int(frames.can_id[i])
            yield int(frames.bus[i]), identifier(announced_group(data), can_id & 0xFF, can_id >> 8 & 0xFF)
