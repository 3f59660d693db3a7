"""The values of a channel out of the records of its group, for all records at once."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ingest.formats import SHOWN
from ingest.formats._mdf_blocks import BrokenBlock, MdfChannel

TIMES = (2, 3)  # kinds of a channel of time
VIRTUAL = (3, 6)  # kinds of a channel that lies in no record
TEXTS = 6  # forms from here on are texts or bytes
SIGNED, FLOATS = (2, 3), (4, 5)  # forms
FLOAT_TYPES = {16: np.float16, 32: np.float32, 64: np.float64}  # by bits
UNSIGNED_TYPES = {16: np.uint16, 32: np.uint32, 64: np.uint64}

Values = NDArray[Any]


def stored(table: NDArray[np.uint8], channel: MdfChannel, first: int = 0) -> Values:
    """The numbers (N,) of a channel as they are stored: uint64, int64 or floats.

    `table` (N, size): the records from number `first` on, which is what a virtual channel counts. Raises BrokenBlock.
    """
    if channel.kind in VIRTUAL:
        return np.arange(first, first + len(table))
    width = (channel.bit + channel.bits + 7) // 8
    if channel.bits == 0 or not 0 < width <= 9 or channel.byte + width > table.shape[1] or channel.bits > 64:
        raise BrokenBlock(f'is damaged: channel "{channel.name[:SHOWN]}" lies outside its records')
    octets = table[:, channel.byte : channel.byte + width]
    octets = octets[:, ::-1] if channel.form % 2 and channel.form < TEXTS else octets
    raw = _shifted(octets, channel.bit)
    if channel.form in FLOATS:
        if channel.bits not in FLOAT_TYPES:
            raise BrokenBlock(f'is damaged: channel "{channel.name[:SHOWN]}" is a float of {channel.bits} bits')
        return raw.astype(UNSIGNED_TYPES[channel.bits]).view(FLOAT_TYPES[channel.bits])
    beyond = np.uint64(64 - channel.bits)
    if channel.form in SIGNED:
        return (raw << beyond).view(np.int64) >> beyond.astype(np.int64)
    return raw << beyond >> beyond


def _shifted(octets: NDArray[np.uint8], bit: int) -> NDArray[np.uint64]:
    """Bytes (N, up to 9), the lowest first, as words (N,) from `bit` on."""
    whole = np.zeros((len(octets), 16), np.uint8)
    whole[:, : octets.shape[1]] = octets
    low, high = whole.view("<u8").T
    shift = np.uint64(bit)
    return low >> shift | (high << np.uint64(64 - bit) if bit else np.uint64(0))


def values(table: NDArray[np.uint8], channel: MdfChannel, first: int = 0) -> Values:
    """The numbers (N,) of a channel, converted. As `stored`."""
    return channel.conversion.numbers(stored(table, channel, first))


def invalid(table: NDArray[np.uint8], channel: MdfChannel) -> NDArray[np.bool_]:
    """Which values (N,) of a channel its records say are none. `channel.invalid_bit`: where, None where nowhere."""
    if channel.never_valid:
        return np.ones(len(table), np.bool_)
    bit = channel.invalid_bit
    if bit is None or bit // 8 >= table.shape[1]:
        return np.zeros(len(table), np.bool_)
    return np.asarray(table[:, bit // 8] >> (bit % 8) & 1 != 0)
