"""A log is read by a child process that is limited in time and memory: a damaged file ends the child, never the program.

`record` starts `python -m ingest.reading`, gives it the request as JSON on standard input and takes one JSON answer from
its standard output. The child opens the log and writes the recording; the parent returns what was read, or raises.
"""

from __future__ import annotations

import base64
import errno
import json
import os
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ingest.errors import UnreadableLogError
from ingest.formats import Rejected, TimeSpec

if TYPE_CHECKING:  # the parent needs neither Arrow nor MCAP
    from ingest.recording import Attachment

SHOWN_REJECTIONS = 100  # of the first rejected records; the recording keeps all of them
MIB = 1 << 20
NO_MEMORY = (
    b"MemoryError",
    b"bad_alloc",
    b"failed to map segment",
    b"Cannot allocate memory",
)  # in a child's last words


@dataclass(frozen=True)
class Limits:
    """What reading one log may cost: address space [bytes], and seconds, of the clock and of computing."""

    memory_bytes: int = 4096 * MIB
    seconds: float = 60.0

    @classmethod
    def of(cls, path: Path) -> Limits:
        """For a log of this size: a minute, and one second more for each 250 kB."""
        return cls(seconds=60.0 + path.stat().st_size / 250_000)


@dataclass(frozen=True)
class Reading:
    """What a log gave. found = written + rejected; `ids`: "can1:0x123" -> frames; times [ns], None without a record."""

    format: str
    holds: str  # "frames" or "rows"
    found: int
    written: int
    rejected: int
    absolute: bool
    start_ns: int | None
    end_ns: int | None
    cut: str | None
    units: Mapping[str, str] = field(default_factory=dict)
    settings: Mapping[str, Any] = field(default_factory=dict)
    rejections: tuple[Rejected, ...] = ()  # the first SHOWN_REJECTIONS
    buses: tuple[int, ...] = ()
    ids: Mapping[str, int] = field(default_factory=dict)
    columns: tuple[str, ...] = ()


def record(
    path: Path,
    target: Path,
    time: TimeSpec | None = None,
    attachments: Sequence[Attachment] = (),
    limits: Limits | None = None,
) -> Reading:
    """Read the log `path` in a child process and write its recording to `target`.

    Raises UnreadableLogError where nothing can be read, or where reading would cost more than `limits` (default:
    `Limits.of(path)`); OSError where `target` cannot be written (disk full) or `path` not be opened. What was written
    of `target` by then is removed. An interrupt (Ctrl-C) ends the child as well.
    """
    limits = limits or Limits.of(path)
    request = {
        "path": str(path.absolute()),
        "target": str(target.absolute()),
        "time": asdict(time or TimeSpec()),
        "attachments": [asdict(entry) | {"data": base64.b64encode(entry.data).decode()} for entry in attachments],
        "limits": asdict(limits),
    }
    try:
        return _reading(_ask_child(path.name, request, limits), path)
    except BaseException:
        with suppress(OSError):
            target.unlink(missing_ok=True)
        raise


def preview(path: Path, folder: Path, time: TimeSpec | None = None) -> Reading:
    """What is in `path`, before anything is stored; its recording becomes `folder / "preview.mcap"`. Raises as `record`."""
    return record(path, folder / "preview.mcap", time)


# ---- parent --------------------------------------------------------------------------------------------------------


def _ask_child(name: str, request: Mapping[str, Any], limits: Limits) -> dict[str, Any]:
    command = [sys.executable, "-P", "-m", "ingest.reading"]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, env=_environment(), stdin=pipe, stdout=pipe, stderr=pipe) as child:
        try:
            out, err = child.communicate(json.dumps(request).encode(), timeout=limits.seconds)
        except subprocess.TimeoutExpired:
            raise UnreadableLogError(_too_slow(name, limits)) from None
        finally:
            child.kill()  # where it has ended, this does nothing
            child.wait()
    if child.returncode != 0:
        raise UnreadableLogError(_ended(name, child.returncode, err, limits))
    answer: dict[str, Any] = json.loads(out)
    return answer


def _environment() -> dict[str, str]:
    """This very code, and libraries that neither start threads nor set memory aside that is never used."""
    ours = str(Path(__file__).resolve().parents[1])
    path = os.pathsep.join([ours, *filter(None, [os.environ.get("PYTHONPATH")])])
    lean = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "ARROW_DEFAULT_MEMORY_POOL": "system"}
    return {**os.environ, **lean, "PYTHONPATH": path}


def _reading(answer: dict[str, Any], path: Path) -> Reading:
    if "unreadable" in answer:
        raise UnreadableLogError(answer["unreadable"])
    if "os_error" in answer:
        raise OSError(*answer["os_error"])
    entries = [Rejected(**entry | {"raw": bytes.fromhex(entry["raw"])}) for entry in answer.pop("rejections")]
    columns, buses = tuple(answer.pop("columns")), tuple(answer.pop("buses"))
    return Reading(**answer, rejections=tuple(entries), columns=columns, buses=buses)


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
    try:
        import resource
    except ImportError:  # Windows: the parent's clock is the only limit there
        return
    cpu = max(1, round(seconds))
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
            return {"unreadable": _too_big(path.name, request["limits"]["memory_bytes"])}
        return {"os_error": [error.errno or errno.EIO, error.strerror or str(error), error.filename or str(target)]}
    except MemoryError:
        return {"unreadable": _too_big(path.name, request["limits"]["memory_bytes"])}


def _read(path: Path, target: Path, time: TimeSpec, attached: Sequence[dict[str, str]]) -> dict[str, Any]:
    from ingest.formats import open_log, recognise
    from ingest.recording import Attachment, write

    log = open_log(path, time)
    attachments = [Attachment(one["name"], base64.b64decode(one["data"]), one["media_type"]) for one in attached]
    contents = write(target, log, attachments)
    entry = recognise(path)
    rejections = [asdict(one) | {"raw": one.raw.hex()} for one in log.rejected[:SHOWN_REJECTIONS]]
    return {"format": entry.name, "holds": entry.holds, "rejections": rejections, **vars(contents)}


def main() -> None:
    """The child: one request in, one answer out."""
    request = json.load(sys.stdin.buffer)
    _limit(**request["limits"])
    sys.stdout.write(json.dumps(_answer(request)))


if __name__ == "__main__":
    main()
