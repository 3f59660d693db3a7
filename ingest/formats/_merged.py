"""Records of several streams that each have an order, in one order, in parts: few of each stream are in memory."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]
MOST = 400_000  # records whose keys are in memory, where there are not too many streams for that
LEAST = 4096  # of a stream


def part_size(streams: int) -> int:
    """How many records a part of each of so many streams may have."""
    return max(LEAST, MOST // max(1, streams))


def rows(streams: Sequence[Iterator[Ints]], size: int) -> Iterator[list[Ints]]:
    """The rows (N,) of the next records of each stream, for `size` rows after another.

    A stream gives the keys (K, N) of its records in parts, none empty and no key twice, which rise from the first line
    on. Records with equal keys are one row.
    """
    first = count = 0
    owner, row = np.empty(0, np.int64), np.empty(0, np.int64)
    for owners, keys in _merged(streams):
        new = (np.diff(keys, prepend=keys[:, :1]) != 0).any(axis=0)  # what shares a key comes in one part
        owner, row = np.concatenate([owner, owners]), np.concatenate([row, count + np.cumsum(new)])
        count = int(row[-1]) + 1
        while count - first >= size:
            cut = int(np.searchsorted(row, first + size))
            yield _by_stream(owner[:cut], row[:cut], len(streams))
            owner, row, first = owner[cut:], row[cut:], first + size
    if len(row):
        yield _by_stream(owner, row, len(streams))


def _by_stream(owner: Ints, row: Ints, count: int) -> list[Ints]:
    order = np.argsort(owner, kind="stable")
    return np.split(row[order], np.cumsum(np.bincount(owner, minlength=count))[:-1])


def _merged(streams: Sequence[Iterator[Ints]]) -> Iterator[tuple[Ints, Ints]]:
    """(whose they are (N,), keys (K, N)) of the next records of all streams, up to the first end of what is read."""
    held = {number: keys for number, stream in enumerate(streams) for keys in [next(stream, None)] if keys is not None}
    while held:
        last = min(keys[:, -1].tolist() for keys in held.values())
        near = {number: keys[:, : np.searchsorted(keys[0], last[0], "right")] for number, keys in held.items()}
        owner = np.repeat([*near], [keys.shape[1] for keys in near.values()])
        whole = np.concatenate([*near.values()], axis=1)
        order = np.lexsort(whole[::-1])
        order = order[: len(order) - int(_above(whole, last).sum())]
        yield owner[order], whole[:, order]
        taken = np.bincount(owner[order], minlength=len(streams)).tolist()
        for number, keys in [*held.items()]:
            rest: Ints | None = keys[:, taken[number] :]
            if taken[number] == keys.shape[1]:
                rest = next(streams[number], None)
            if rest is None:
                del held[number]
            else:
                held[number] = rest


def _above(keys: Ints, key: Sequence[int]) -> NDArray[np.bool_]:
    """Which of some keys (K, N) are above one."""
    above = np.zeros(keys.shape[1], np.bool_)
    for line, one in zip(keys[::-1], key[::-1], strict=True):
        above = (line > one) | ((line == one) & above)
    return above
