"""A batch of CAN frames taken apart: by identifier, and each message into the values of its signals."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from ingest.formats import REMOTE, Frames
from ingest.log.arrow import from_numpy, to_numpy
from ingest.log.bits import Payloads, Words, extract, padded, raw
from ingest.log.databases import Message, MessageSignal
from ingest.log.j1939 import no_numbers

Positions = NDArray[np.intp]


class FrameBatch:
    """N frames of one bus, ready to be taken apart. `remote`: positions of remote frames, which hold no data."""

    def __init__(self, frames: Frames) -> None:
        self.frames = frames
        self.remote = np.flatnonzero(frames.flags & REMOTE)
        self.lengths = np.diff(frames.offsets)  # of the payloads [bytes]
        self.not_available: Counter[str] = Counter()  # "message.signal" -> how often it says so
        self.errors: Counter[str] = Counter()  # and how often that there is an error
        self._data = padded(frames.data)

    def by_identifier(self) -> Iterator[tuple[int, int, Positions]]:
        """(bus, can_id, positions of its frames with data, in the order of the file): one stable sort for all."""
        with_data = np.flatnonzero((self.frames.flags & REMOTE) == 0)
        coded = from_numpy(self.frames.can_id[with_data]).dictionary_encode()
        codes, count = to_numpy(coded.indices), len(coded.dictionary)
        order = np.argsort(codes.astype(np.uint16) if count < 2**16 else codes, kind="stable")
        stops = np.cumsum(np.bincount(codes, minlength=count)).tolist()
        for can_id, start, stop in zip(coded.dictionary.to_pylist(), [0, *stops], stops, strict=False):
            yield int(self.frames.bus[0]), can_id, with_data[order[start:stop]]

    def long_enough(self, message: Message, at: Positions) -> Positions:
        """Which of the frames `at` are as long as `message`, or longer."""
        return at[self.lengths[at] >= message.length]

    def signals(
        self, message: Message, at: Positions, only: Collection[str] | None = None
    ) -> dict[str, NDArray[np.float64]]:
        """Signal name -> values (M,) in the database's unit, of the M frames `at`, all long enough for `message`.

        NaN where a frame does not hold a signal: by its multiplexer, or because the signal lies behind the frame's end.
        """
        payloads = Payloads(self._data, self.frames.offsets[at])
        by_name = {signal.name: signal for signal in message.signals}
        present = _Present(payloads, self.lengths[at], by_name)

        def values(name: str) -> NDArray[np.float64]:
            there = present.of(name)
            if not there.any():
                return np.full(len(at), np.nan)
            signal = by_name[name]
            found = extract(payloads, signal.layout)
            if message.is_j1939 or signal.errors or signal.not_available:
                there = there & self._is_number(message, signal, there, raw(payloads, signal.layout))
            return found if there.all() else np.where(there, found, np.nan)

        return {name: values(name) for name in by_name if only is None or name in only}

    def _is_number(
        self, message: Message, signal: MessageSignal, there: NDArray[np.bool_], bits: Words
    ) -> NDArray[np.bool_]:
        """Whether the bits (M,) of a signal are a number, by their names and in J1939; counts those that are none."""
        error = np.isin(bits, np.array(signal.errors, np.uint64))
        not_available = np.isin(bits, np.array(signal.not_available, np.uint64))
        if message.is_j1939:
            also_error, also_none = no_numbers(bits, signal.layout)
            error, not_available = error | also_error, not_available | also_none
        for counts, said in ((self.errors, error), (self.not_available, not_available)):
            if count := int((said & there).sum()):
                counts[f"{message.name}.{signal.name}"] += count
        return ~(error | not_available)


class _Present:
    """Which of M frames hold which signal. (A class, as a cached function that calls itself would keep the payloads of
    each batch in memory until Python looks for cycles.)"""

    def __init__(self, payloads: Payloads, lengths: NDArray[np.int64], signals: Mapping[str, MessageSignal]) -> None:
        self._payloads, self._lengths, self._signals = payloads, lengths, signals
        self._known: dict[str, NDArray[np.bool_]] = {}

    def of(self, name: str) -> NDArray[np.bool_]:
        """Whether the signal is in each frame (M,). A multiplexer may be multiplexed itself."""
        if name not in self._known:
            signal = self._signals[name]
            there: NDArray[np.bool_] = self._lengths >= signal.layout.bytes_needed
            if signal.multiplexer is not None and there.any():
                selector = raw(self._payloads, self._signals[signal.multiplexer].layout)
                there = there & self.of(signal.multiplexer) & np.isin(selector, np.array(signal.when, np.uint64))
            self._known[name] = there
        return self._known[name]
