"""One function over many jobs, with an executor of `concurrent.futures`; a worker that ends costs its own job alone."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future, ProcessPoolExecutor, as_completed
from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context
from typing import TypeVar

PATIENCE = 2  # rounds that end without a result before jobs are tried one by one

J = TypeVar("J")
R = TypeVar("R")


@dataclass(frozen=True)
class Workers:
    """Where jobs run. `open`: an executor for so many jobs, anew for each round; `ended`: what a job raises there whose
    worker ended before it."""

    open: Callable[[int], AbstractContextManager[Executor]]
    ended: tuple[type[Exception], ...] = (BrokenExecutor,)


@dataclass(frozen=True)
class Lost:
    """Instead of a result: the worker ended each time that it had this job, alone at last."""

    why = "the process that worked on it ended each time, as one does that needs more memory than there is"


def processes(count: int) -> Workers | None:
    """So many processes of this machine; None, which is this process, for one."""
    return Workers(partial(_processes, count)) if count > 1 else None


def _processes(count: int, jobs: int) -> Executor:
    return ProcessPoolExecutor(min(count, jobs), mp_context=get_context("spawn"))


def each(work: Callable[[J], R], jobs: Sequence[J], workers: Workers | None) -> Iterator[tuple[J, R | Lost]]:
    """Every job with what `work` makes of it: in order in this process (`workers` None), as they are done elsewhere.

    Both must be picklable there, and `work` may be run again over a job whose worker ended. Raises what `work` raises.
    """
    if workers is None:
        yield from ((job, work(job)) for job in jobs)
        return
    left, fruitless = dict(enumerate(jobs)), 0
    while left:
        alone = fruitless >= PATIENCE
        some = [next(iter(left))] if alone else [*left]
        before = len(left)
        for i, result in _round(work, {i: left[i] for i in some}, workers):
            yield left.pop(i), result
        if len(left) < before:
            fruitless = 0
        elif alone:
            yield left.pop(some[0]), Lost()
        else:
            fruitless += 1


def told(results: Iterator[R], what: str, names: Sequence[str], tell: Callable[[str], None]) -> Iterator[R]:
    """As many results as there are names; before each is waited for, `tell` hears which one it is."""
    for number, name in enumerate(names, 1):
        tell(f"{what} {number} of {len(names)}: {name}")
        yield next(results)


def _round(work: Callable[[J], R], jobs: dict[int, J], workers: Workers) -> Iterator[tuple[int, R]]:
    """What was done by the end of all jobs or of the executor."""
    gone: tuple[type[Exception], ...] = (CancelledError, *workers.ended)
    with workers.open(len(jobs)) as executor:
        futures: dict[Future[R], int] = {}
        try:
            for i, job in jobs.items():
                futures[executor.submit(work, job)] = i
        except workers.ended:
            pass  # it ended while it was given jobs: what it has done by now counts
        try:
            for future in as_completed(futures):
                try:
                    result = future.result()
                except gone:
                    continue
                yield futures[future], result
        finally:
            for future in futures:
                future.cancel()
