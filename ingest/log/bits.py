"""Signals out of payloads: any width and byte order, for all frames of a message at once.

A signal's bits are brought to the top of a 64-bit word and shifted back down: arithmetically where it is signed. Bit
numbering is that of DBC files: `start` counts 8 bits a byte with bit 0 the least significant of each byte; it names
the least significant bit of an Intel signal and the most significant of a Motorola one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Words = NDArray[np.uint64]
EXACT = 2**53  # integers up to here are exact in float64
FLOATS = {16: np.float16, 32: np.float32, 64: np.float64}
_UNSIGNED = {16: np.uint16, 32: np.uint32, 64: np.uint64}


@dataclass(frozen=True)
class Layout:
    """Where a signal lies in a payload, and its linear law: value = scale * raw + offset, in the DBC's unit."""

    start: int
    length: int  # bits, 1 to 64; 16, 32 or 64 where `is_float`
    big_endian: bool = False
    signed: bool = False
    is_float: bool = False  # IEEE 754
    scale: float = 1  # an int stays one: integer laws are exact until the end, as Python's are
    offset: float = 0

    @property
    def first_byte(self) -> int:
        """The byte of the payload that holds bit `start`."""
        return self.start // 8

    @property
    def skip(self) -> int:
        """Bits of the first byte before the signal: at the low end (Intel), at the high end (Motorola)."""
        return 7 - self.start % 8 if self.big_endian else self.start % 8

    @property
    def bytes_needed(self) -> int:
        """Length of the shortest payload that holds the signal [bytes]."""
        return self.first_byte + (self.skip + self.length + 7) // 8


class Payloads:
    """The payloads of N frames in one buffer, as 64-bit words; a word is made once however many signals share it."""

    def __init__(self, data: NDArray[np.uint8], starts: NDArray[np.int64]) -> None:
        """`data`: the buffer, from `padded`; `starts` (N,): where in it each payload begins."""
        self._data = data
        self._starts = starts
        self._at_any_byte = np.ndarray((len(data) - 7,), "<u8", data, strides=(1,))
        self._words: dict[tuple[int, bool], Words] = {}

    def byte(self, at: int) -> Words:
        """The byte `at` of each payload (N,), as words."""
        return self._data[self._starts + at].astype(np.uint64)

    def word(self, at: int, big_endian: bool) -> Words:
        """The eight bytes from `at`, as a word of the given byte order."""
        if (at, big_endian) not in self._words:
            word = self._at_any_byte[self._starts + at].astype(np.uint64)
            self._words[at, big_endian] = word.byteswap() if big_endian else word
        return self._words[at, big_endian]


def padded(data: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """`data` with as many zeros behind it as any signal of a CAN FD frame can reach."""
    return np.concatenate([data, np.zeros(72, np.uint8)])


def raw(payloads: Payloads, layout: Layout) -> Words:
    """The signal's bits (N,), in the low end of each word, not sign-extended."""
    return _at_top(payloads, layout) >> np.uint64(64 - layout.length)


def extract(payloads: Payloads, layout: Layout) -> NDArray[np.float64]:
    """The signal's values (N,), in the DBC's unit; equal to the last bit to Python's `raw * scale + offset`."""
    if layout.is_float:
        bits = raw(payloads, layout).astype(_UNSIGNED[layout.length])
        with np.errstate(invalid="ignore"):  # signalling NaN
            values = bits.view(FLOATS[layout.length]).astype(np.float64)
        return _scaled(values, layout)
    top, down = _at_top(payloads, layout), 64 - layout.length
    integers = top.view(np.int64) >> np.int64(down) if layout.signed else top >> np.uint64(down)
    if isinstance(layout.scale, int) and abs(layout.scale) * 2**layout.length > EXACT and not _is_raw(layout):
        return (integers.astype(object) * layout.scale + layout.offset).astype(np.float64)
    return _scaled(integers.astype(np.float64), layout)


def _at_top(payloads: Payloads, layout: Layout) -> Words:
    """The signal's bits at the high end of each word; below it may be anything."""
    at, skip = layout.first_byte // 8 * 8, layout.skip + layout.first_byte % 8 * 8
    if skip + layout.length > 64:
        at, skip = layout.first_byte, layout.skip
    word, beyond = payloads.word(at, layout.big_endian), skip + layout.length - 64
    if layout.big_endian:
        top = word << np.uint64(skip)
        return top | (payloads.byte(at + 8) >> np.uint64(8 - skip)) if beyond > 0 else top
    if beyond <= 0:
        return word << np.uint64(-beyond)
    low = (word >> np.uint64(skip)) | (payloads.byte(at + 8) << np.uint64(64 - skip))
    return low << np.uint64(64 - layout.length)


def _scaled(values: NDArray[np.float64], layout: Layout) -> NDArray[np.float64]:
    if _is_raw(layout):
        return values
    with np.errstate(over="ignore", invalid="ignore"):  # an infinite or undefined float in a payload stays one
        return values * layout.scale + layout.offset


def _is_raw(layout: Layout) -> bool:
    return layout.scale == 1 and layout.offset == 0
