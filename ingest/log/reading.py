"""A log is read by a child process with limits of time and memory: a damaged file ends the child, never the program.

A `Reader` starts `python -m ingest.log.reading`, gives it requests on standard input and takes an answer to each from
its standard output, a line of JSON each. The child opens the log and writes the recording; the parent returns what was
read, or raises. Small logs are read by one child in turn, as its start takes longer than they do. The limits hold for
each log alone, and a log at which a used child ended is read again by a new one: none is refused for another.
"""

from __future__ import annotations

import base64
import errno
import json
import math
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time as clock
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import IO, Any, cast

from ingest.errors import UnreadableLogError
from ingest.formats import Rejected, TimeSpec, open_log, recognise
from ingest.log.recording import Attachment, Contents, write

SHOWN_REJECTIONS = 100  # of the first rejected records; the recording keeps all of them
MIB = 1 << 20
SMALL_BYTES = 8 * MIB  # a larger log has a child of its own: it may need all the memory, and the start is a small part
LAST_WORDS_BYTES = 1 << 16  # kept of what a child complains of
KEPT_BYTES = 64 * MIB  # of memory that the child has used
NO_MEMORY = (  # in its last words
    b"MemoryError",
    b"bad_alloc",
    b"failed to map segment",
    b"Cannot allocate memory",
    b"memory allocation of",
    b"can't start new thread",
    b"ValueError: field '",  # ... "is required for": from Python's compiler, of an import that memory ended in
)


@dataclass(frozen=True)
class Limits:
    """What reading one log may cost: address space [bytes], and seconds, of the clock and of computing."""

    memory_bytes: int = 4096 * MIB
    seconds: float = 60.0

    @classmethod
    def of(cls, path: Path) -> Limits:
        """For a log of this size: a minute, and one second more for each 250 kB."""
        return cls(seconds=60.0 + path.stat().st_size / 250_000)


@dataclass(frozen=True, kw_only=True)
class LogReading(Contents):
    """What a log gave."""

    format: str
    holds: str  # "frames" or "rows"
    rejections: tuple[Rejected, ...] = ()  # the first SHOWN_REJECTIONS


class Reader:
    """Reads logs one after another, up to `close`."""

    def __init__(self) -> None:
        self._child: _Child | None = None

    def record(
        self,
        path: Path,
        target: Path,
        time: TimeSpec | None = None,
        attachments: Sequence[Attachment] = (),
        limits: Limits | None = None,
    ) -> LogReading:
        """Read the log `path` in a child process and write its recording to `target`.

        Raises UnreadableLogError where nothing can be read, or where reading would cost more than `limits` (default:
        `Limits.of(path)`); OSError where `target` cannot be written (disk full) or `path` not be opened. What was
        written of `target` by then is removed. An interrupt (Ctrl-C) ends the child as well.
        """
        limits = limits or Limits.of(path)
        request = {
            "path": str(path.absolute()),
            "target": str(target.absolute()),
            "time": asdict(time or TimeSpec()),
            "attachments": [asdict(entry) | {"data": base64.b64encode(entry.data).decode()} for entry in attachments],
            "limits": asdict(limits),
        }
        small = path.stat().st_size <= SMALL_BYTES
        try:
            if not small:
                self.close()
            answer = self._answer(path.name, request, limits)
            if not small:
                self.close()
            return _reading(answer, path)
        except BaseException:
            with suppress(OSError):
                target.unlink(missing_ok=True)
            raise

    def _answer(self, name: str, request: Mapping[str, Any], limits: Limits) -> dict[str, Any]:
        """What the child says; of one that was used before and ended, what a new one says."""
        new = self._child is None
        child = self._child = self._child or _Child()
        try:
            line = child.ask(json.dumps(request).encode(), limits.seconds)
            answer: dict[str, Any] = json.loads(line) if line else {}
        except BaseException:
            self.close()
            raise
        if answer and "no_memory" not in answer:
            return answer
        self.close()
        if child.was_slow:
            raise UnreadableLogError(_too_slow(name, limits))
        if not new:
            return self._answer(name, request, limits)
        if answer:
            raise UnreadableLogError(_too_big(name, limits.memory_bytes))
        raise UnreadableLogError(_ended(name, child.process.returncode, bytes(child.last_words), limits))

    def close(self) -> None:
        """End the child, if there is one."""
        if self._child is not None:
            self._child.end()
            self._child = None


# ---- parent --------------------------------------------------------------------------------------------------------


class _Child:
    """The child process as the parent sees it: a line in, a line out."""

    def __init__(self) -> None:
        command, pipe = [sys.executable, "-P", "-m", "ingest.log.reading"], subprocess.PIPE
        self.process = subprocess.Popen(command, env=_environment(), stdin=pipe, stdout=pipe, stderr=pipe)
        self.was_slow = False
        self.last_words = bytearray()
        self._pipes = [cast(IO[bytes], one) for one in (self.process.stdin, self.process.stdout, self.process.stderr)]
        self._listener = threading.Thread(target=self._listen, daemon=True)
        self._listener.start()

    def ask(self, request: bytes, seconds: float) -> bytes:
        """The answer, or b"" where the child ended, `was_slow` where that was because it took longer than `seconds`."""
        requests, answers, _ = self._pipes
        self.was_slow = False
        timer = threading.Timer(seconds, self._stop)
        timer.start()
        try:
            with suppress(OSError):  # it has ended: there is no answer either
                requests.write(request + b"\n")
                requests.flush()
            line = answers.readline()
            if line.endswith(b"\n"):
                return line
            self.process.wait()  # it has last words to say, and an exit code
            return b""
        finally:
            timer.cancel()

    def end(self) -> None:
        """End the child, and wait for it."""
        self.process.kill()
        self.process.wait()
        self._listener.join()
        for pipe in self._pipes:
            with suppress(OSError):  # a request that was not taken
                pipe.close()

    def _stop(self) -> None:
        self.was_slow = True
        self.process.kill()

    def _listen(self) -> None:
        """Hear what the child complains of, so that it never waits for a listener."""
        errors = self._pipes[2]
        while words := os.read(errors.fileno(), LAST_WORDS_BYTES):
            self.last_words[:] = (self.last_words + words)[-LAST_WORDS_BYTES:]


def _environment() -> dict[str, str]:
    """This very code; libraries that neither start threads nor set memory aside that is never used; and memory that is
    kept for the next batch of records: to ask the system for it anew takes a seventh of the time of reading a BLF."""
    ours = str(Path(__file__).resolve().parents[2])
    path = os.pathsep.join([ours, *filter(None, [os.environ.get("PYTHONPATH")])])
    lean = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "ARROW_DEFAULT_MEMORY_POOL": "system"}
    kept = dict.fromkeys(("MALLOC_MMAP_THRESHOLD_", "MALLOC_TRIM_THRESHOLD_"), str(KEPT_BYTES))
    return {**os.environ, **lean, **kept, "PYTHONPATH": path}


def _reading(answer: dict[str, Any], path: Path) -> LogReading:
    if "unreadable" in answer:
        raise UnreadableLogError(answer["unreadable"])
    if "os_error" in answer:
        raise OSError(*answer["os_error"])
    entries = [Rejected(**entry | {"raw": bytes.fromhex(entry["raw"])}) for entry in answer.pop("rejections")]
    columns, buses = tuple(answer.pop("columns")), tuple(answer.pop("buses"))
    return LogReading(**answer, rejections=tuple(entries), columns=columns, buses=buses)


def _too_slow(name: str, limits: Limits) -> str:
    return (
        f"{name}: reading it was stopped after {limits.seconds:.0f} s: it is not a log of this size, or the machine is "
        "too busy. Look at the file, or read it again."
    )


def _too_big(name: str, memory_bytes: int) -> str:
    return (
        f"{name}: reading it needs more than {memory_bytes // MIB:,} MiB of memory: stopped. Look at the file; a log "
        "that is whole can be split into shorter ones."
    )


def _ended(name: str, code: int, err: bytes, limits: Limits) -> str:
    if code == -getattr(signal, "SIGXCPU", 0):
        return _too_slow(name, limits)
    lines = err.decode(errors="replace").strip().splitlines()
    if any(sign in err for sign in NO_MEMORY):
        return _too_big(name, limits.memory_bytes)
    how = f"signal {-code}" if code < 0 else f"exit code {code}"
    says = f" ({lines[-1][:200]})" if lines else ""
    return f"{name}: the reader ended with {how}{says}. This is a defect of the reader: report it with the file."


# ---- child ---------------------------------------------------------------------------------------------------------


def _limit(memory_bytes: int, seconds: float) -> None:
    """Let this process have so much memory, and so many more seconds of computing."""
    try:
        import resource
    except ImportError:  # Windows: the parent's clock is the only limit there
        return
    cpu = math.ceil(clock.process_time() + seconds)
    for what, least in ((resource.RLIMIT_AS, memory_bytes), (resource.RLIMIT_CPU, cpu)):
        hard = resource.getrlimit(what)[1]
        allowed = least if hard == resource.RLIM_INFINITY else min(least, hard)
        resource.setrlimit(what, (allowed, hard))


def _answer(request: dict[str, Any]) -> dict[str, Any]:
    path, target = Path(request["path"]), Path(request["target"])
    try:
        return _read(path, target, TimeSpec(**request["time"]), request["attachments"])
    except UnreadableLogError as error:
        return {"unreadable": str(error)}
    except OSError as error:
        if error.errno == errno.ENOMEM:
            return {"no_memory": True}
        return {"os_error": [error.errno or errno.EIO, error.strerror or str(error), error.filename or str(target)]}
    except MemoryError:
        return {"no_memory": True}


def _read(path: Path, target: Path, time: TimeSpec, attached: Sequence[dict[str, str]]) -> dict[str, Any]:
    tempfile.tempdir = str(target.parent)  # of what waits in files
    log = open_log(path, time)
    attachments = [Attachment(one["name"], base64.b64decode(one["data"]), one["media_type"]) for one in attached]
    contents = write(target, log, attachments)
    entry = recognise(path)
    rejections = [asdict(one) | {"raw": one.raw.hex()} for one in log.rejected[:SHOWN_REJECTIONS]]
    return {"format": entry.name, "holds": entry.holds, "rejections": rejections, **vars(contents)}


class _Lean:
    """pyarrow imports these wherever they are installed, for nothing here: half of the time that a small log takes."""

    UNUSED = ("pandas", "cloudpickle")

    def find_spec(self, fullname: str, path: object, target: object = None) -> None:
        if fullname in self.UNUSED:
            raise ModuleNotFoundError(fullname)


def main() -> None:
    """The child: an answer to each request, until there are no more."""
    sys.meta_path.insert(0, _Lean())
    with os.fdopen(os.dup(1), "w") as answers:
        os.dup2(2, 1)  # what a library prints is no answer
        for line in sys.stdin.buffer:
            request = json.loads(line)
            _limit(**request["limits"])
            answers.write(json.dumps(_answer(request)) + "\n")
            answers.flush()


if __name__ == "__main__":
    main()
