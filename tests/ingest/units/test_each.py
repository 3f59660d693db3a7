"""Jobs handed to processes and threads: every one comes back once, whoever dies."""

from __future__ import annotations

import os
from concurrent.futures import Executor, ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

import pytest

from ingest.errors import StoreError
from ingest.units.each import Lost, Workers, each, processes
from ingest.units.shared import Shared, share


class Count(NamedTuple):
    """A job: the square of `number`, that of one `deadly` after its worker ended so often."""

    number: int
    folder: Path
    deadly: int = 0


def square(job: Count) -> int:
    deaths = len([*job.folder.glob(f"{job.number}.*")])
    if deaths < job.deadly:
        (job.folder / f"{job.number}.{deaths}").touch()
        os._exit(9)
    return job.number**2


def threads(jobs: int) -> Executor:
    return ThreadPoolExecutor(min(jobs, 3))


@pytest.mark.parametrize("workers", [None, Workers(threads)], ids=["here", "threads"])
def test_every_job_comes_back_with_its_result(workers: Workers | None, tmp_path: Path) -> None:
    found = [*each(square, [Count(i, tmp_path) for i in range(20)], workers)]
    assert sorted((job.number, result) for job, result in found) == [(i, i**2) for i in range(20)]


def test_a_killed_worker_costs_its_job_alone_and_only_time(tmp_path: Path) -> None:
    jobs = [Count(i, tmp_path, deadly=2 if i == 3 else 0) for i in range(6)]
    found = [*each(square, jobs, processes(2))]
    assert sorted((job.number, result) for job, result in found) == [(i, i**2) for i in range(6)]
    assert len([*tmp_path.iterdir()]) == 2


def test_a_job_that_always_kills_its_worker_is_said_to_be_lost_and_no_other(tmp_path: Path) -> None:
    jobs = [Count(i, tmp_path, deadly=99 if i == 1 else 0) for i in range(4)]
    found = {job.number: result for job, result in each(square, jobs, processes(2))}
    assert found == {0: 0, 1: Lost(), 2: 4, 3: 9}


def fails(job: Count) -> int:
    raise ZeroDivisionError(job.number)


def test_what_a_job_raises_is_raised_here(tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError):
        [*each(fails, [Count(7, tmp_path)], Workers(threads))]


def test_one_process_is_this_one() -> None:
    assert processes(1) is None


def test_what_is_shared_is_read_once_and_only_as_it_was_written(tmp_path: Path) -> None:
    shared = share({"facts": [1, 2]}, tmp_path)
    assert shared.value() == {"facts": [1, 2]}
    assert shared.value() is shared.value()
    other: Shared[object] = Shared(tmp_path / ("0" * 64))
    with pytest.raises(StoreError, match="folder that every worker sees under the same path"):
        other.value()
    other.path.write_bytes(b"of another machine")
    with pytest.raises(StoreError, match="as it was written"):
        other.value()
