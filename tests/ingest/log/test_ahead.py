"""The next item is made while the last is in use: the same items, the same errors, one thread that makes them."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import pytest

from ingest.log.ahead import ahead


def test_the_items_come_in_order_and_the_next_is_made_meanwhile() -> None:
    second = threading.Event()

    def items() -> Iterator[int]:
        yield 1
        second.set()
        yield 2

    given = ahead(items())
    assert next(given) == 1
    assert second.wait(10), "nothing is made before it is asked for"
    assert list(given) == [2]


def test_an_error_comes_in_its_turn() -> None:
    def items() -> Iterator[int]:
        yield 1
        raise OSError("the disk is full")

    given = ahead(items())
    assert next(given) == 1
    with pytest.raises(OSError, match="the disk is full"):
        next(given)


def test_what_is_left_early_is_closed_by_the_thread_that_made_it() -> None:
    threads: list[str] = []

    def items() -> Iterator[int]:
        try:
            while True:
                threads.append(threading.current_thread().name)
                yield 0
        finally:
            threads.append(threading.current_thread().name)

    given = ahead(items())
    next(given)
    given.close()  # type: ignore[attr-defined]
    assert len(set(threads)) == 1 and threading.current_thread().name not in threads
