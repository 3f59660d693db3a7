"""A cluster's workers as an executor: dask distributed, the extra `cluster`.

Every worker must be of this version, of this code and of the same packages: the cluster is asked before work, and a
worker that joins later before each of its jobs.
"""

from __future__ import annotations

import hashlib
import logging
import socket
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager
from functools import cache, partial
from pathlib import Path
from typing import Any

from ingest.units.each import Workers
from replay.engine.runs.identity import environment
from replay.errors import ClusterError
from whyhot import PACKAGES, __version__

ROOT = Path(__file__).parents[3]  # the folder that holds our packages
INSTALL = "install whyhot with the extra `cluster`, in a clone: uv tool install '.[cluster]'"
AT_ONCE = 256  # jobs that wait at the scheduler or are under way
WAIT_S = 10  # for the scheduler to answer; its workers have six times as long, as they load whyhot first


def cluster(url: str) -> Workers:
    """The workers of the dask scheduler at `url`. Raises ClusterError where dask is not installed; opening the workers
    does where the scheduler does not answer, has no worker, or has one of another version."""
    try:
        from distributed import KilledWorker
    except ImportError:
        raise ClusterError(f"--scheduler {url}: dask distributed is not installed: {INSTALL}") from None
    for name in ("distributed", "distributed.client"):
        logging.getLogger(name).setLevel(logging.CRITICAL)  # what goes wrong is said in one line, by us
    return Workers(partial(_opened, url), ended=(KilledWorker,))


@contextmanager
def _opened(url: str, jobs: int) -> Iterator[Executor]:
    from distributed import Client

    mine, client = installed(), None
    try:
        try:
            client = Client(url, timeout=WAIT_S, set_as_default=False)
            found = client.sync(client._run, installed, on_error="return", callback_timeout=6 * WAIT_S)
        except (OSError, ValueError) as error:
            raise ClusterError(
                f"--scheduler {url}: no dask scheduler answers there ({_line(error)}): "
                "give the address that `dask scheduler` printed, as tcp://HOST:8786"
            ) from None
        _refuse_others(url, mine, {worker: it for worker, it in found.items() if not isinstance(it, OSError)})  # gone
        with _Waiting(client, mine, jobs) as executor:
            yield executor
    finally:
        if client is not None:
            client.close(timeout=2)


def _refuse_others(url: str, mine: str, theirs: dict[str, str | Exception]) -> None:
    if not theirs:
        raise ClusterError(f"--scheduler {url}: has no worker: start some with `dask worker {url} --nthreads 1`")
    for worker, found in theirs.items():
        if isinstance(found, Exception):
            raise ClusterError(f"{worker}: cannot run whyhot ({_line(found)}): install there what is here, {mine}")
        _refuse_other(worker, mine, found)


def _refuse_other(worker: str, mine: str, found: str) -> None:
    if found != mine:
        raise ClusterError(f"{worker}: has {found}, this is {mine}: install the same on both")


class _Waiting(ThreadPoolExecutor):
    """A thread waits for each job that is under way: dask's own executor waited for ever, some times that a worker was
    killed (distributed 2026.8)."""

    def __init__(self, client: Any, mine: str, jobs: int) -> None:
        super().__init__(min(jobs, AT_ONCE))
        self._client = client
        self._mine = mine

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        return super().submit(self._done, fn, *args, **kwargs)

    def _done(self, fn: Callable[..., Any], *args: Any, **kwargs: Any) -> Any:
        return self._client.submit(_checked, self._mine, fn, *args, pure=False, **kwargs).result()


def _checked(mine: str, fn: Callable[..., Any], *args: Any, **kwargs: Any) -> Any:
    _refuse_other(f"worker on {socket.gethostname()}", mine, installed())
    return fn(*args, **kwargs)


@cache
def installed() -> str:
    """This whyhot and what numbers depend on besides: "whyhot 0.1.0 (code 1f0c..., numpy 2.4.6, ...)"."""
    sha = hashlib.sha256()
    for path in sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py")):
        sha.update(path.relative_to(ROOT).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    machine = ("machine", "cpu")  # on which digests do not depend
    packages = ", ".join(f"{name} {value}" for name, value in environment().items() if name not in machine)
    return f"whyhot {__version__} (code {sha.hexdigest()[:8]}, {packages})"


def _line(error: BaseException) -> str:
    return " ".join(str(error).split())[:200].rstrip(".") or type(error).__name__
