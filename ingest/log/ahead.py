"""What comes next is made while what came last is worked on: two cores for one log, in the same order."""

from __future__ import annotations

from collections.abc import Generator, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

Item = TypeVar("Item")


class _End:
    """What comes behind the last item."""


def ahead(items: Iterable[Item]) -> Iterator[Item]:
    """The same items in the same order, each made by one other thread while the one before is in use.

    Two are in memory at once. Raises what making them raises, in its turn.
    """
    source = iter(items)
    with ThreadPoolExecutor(1) as maker:
        try:
            coming: Future[Item | _End] = maker.submit(next, source, _End())
            while not isinstance(item := coming.result(), _End):
                coming = maker.submit(next, source, _End())
                yield item
        finally:
            if isinstance(source, Generator):
                maker.submit(source.close)  # by its own thread: what a database opened, only that may close
