"""A machine that refuses: a call of the disk that fails, a disk that is full, memory that ends.

A command then ends with one line and no traceback, its store verifies with nothing of before changed, and the same
command works once the machine is well.
"""

from __future__ import annotations

import errno
import os
import resource
import signal
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import product
from pathlib import Path

from benchmarks.attack import children, subjects
from benchmarks.attack.children import Verb
from benchmarks.attack.kills import Whole, wholes
from benchmarks.attack.outcome import Arena, Attack, Outcome
from ingest.errors import UnreadableLogError
from ingest.log.reading import MIB, Limits, Reader
from made.places import LOGS

SHORT = 0  # no error: a write that takes half of what it is given
ERRORS = (errno.ENOSPC, errno.EDQUOT, errno.EIO, errno.EACCES, errno.EMFILE, errno.ESTALE, SHORT)
WRITE = os.write
FailAt = Callable[[int, children.Act, bool], None]
FORMATS = ("blf", "asc", "mf4", "tdms", "csv")
LIBRARIES = (-signal.SIGABRT, 127)  # exit codes where one in C++ gets no memory, or the linker for a thread
TRACEBACK = ("Traceback", "Exception ignored")


def _refuse(number: int, name: str) -> Callable[..., int] | None:
    """What is called in place of a call of this name. Raises OSError, but where a write is to fall short."""
    if number != SHORT:
        raise OSError(number, os.strerror(number), name)
    return _half if name == "write" else None


def _half(handle: int, data: bytes) -> int:
    return WRITE(handle, data[: -(-len(data) // 2)])


def _wrong(whole: Whole, verb: Verb, how: str, before: Callable[[], object], ends: Sequence[int] = (0, 1, 2)) -> str:
    """What is wrong with a command that met a fault, and with the same command after it; `ends`: its exit codes."""
    code, said = verb.ended(before)
    if code not in ends or any(word in said for word in TRACEBACK):
        return f"{how}: exit code {code}: {said[-300:]}"
    if code == 2 and len([line for line in said.splitlines() if "replaced by the true bytes" not in line]) != 1:
        return f"{how}: more than one line: {said[-300:]}"
    if code == 0 and whole.answer:  # not asked again: a file that it wrote stands
        lost = {*whole.answer.splitlines()} - {*said.splitlines()}
        return f"{how}: exit code 0, but it does not say {sorted(lost)[:2]}: {said[-300:]}" if lost else ""
    return whole.wrong(verb, how, said)


def io_errors(arena: Arena) -> Outcome:
    """T4: a change of a disk, or a file opened or read, fails, once and from then on; of every verb."""
    outcome, chance = Outcome(), arena.chance
    subject = wholes(arena, subjects.VERBS)
    for whole, tries in _shared(arena, subject):
        faults = [*product(_calls(whole), (False, True))]
        for (fail_at, number), on in chance.sample(faults, min(tries, len(faults))):
            error = chance.choice(ERRORS)
            call = f"{fail_at.__name__.removeprefix('at_')} {number}{' and all after it' if on else ''}"
            how = f"{whole.verb}, {errno.errorcode.get(error, 'half a write')} at {call}"
            before = partial(fail_at, number, partial(_refuse, error), on)
            outcome.count(*filter(None, [_wrong(whole, whole.fresh(arena.folder), how, before)]))
    outcome.note = f"calls that can fail: {', '.join(f'{one.verb} {one.changes + one.reads}' for one in subject)}"
    return outcome


def _calls(whole: Whole) -> Iterator[tuple[FailAt, int]]:
    for fail_at, calls in ((children.at_change, whole.changes), (children.at_read, whole.reads)):
        yield from ((fail_at, number) for number in range(calls))


def _shared(arena: Arena, subject: list[Whole]) -> Iterator[tuple[Whole, int]]:
    for number, whole in enumerate(subject):
        yield whole, arena.tries // len(subject) + (number < arena.tries % len(subject))


def full_disk(arena: Arena) -> Outcome:
    """T5: no file may grow beyond a size, as where the disk is full; sizes rise up to that at which all fits."""
    outcome, chance = Outcome(), arena.chance
    for whole, tries in _shared(arena, wholes(arena)):
        for number in range(tries):
            size = round(200 * 3000 ** ((number + chance.random()) / tries))
            how = f"{whole.verb} with files of at most {size:,} bytes"
            outcome.count(*filter(None, [_wrong(whole, whole.fresh(arena.folder), how, partial(_no_larger, size))]))
    outcome.note = "RLIMIT_FSIZE, no disk of its own"
    return outcome


def _no_larger(size: int) -> None:
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    said = os.dup(1)  # what it says is no file on the disk that is full
    reads, writes = os.pipe()
    if os.fork() == 0:
        os.close(writes)
        while words := os.read(reads, 1 << 16):
            os.write(said, words)
        os._exit(0)
    children.say_to(writes)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, resource.getrlimit(resource.RLIMIT_FSIZE)[1]))


def no_memory(arena: Arena) -> Outcome:
    """T6: the child that reads a log has more and more memory, from too little on; a sixth of the tries are replays."""
    replays = arena.tries // 6
    outcome, refused = _read_in(arena, arena.tries - replays)
    for whole in wholes(replace(arena, tries=1, verbs=["replay"])) if replays else ():
        for number in range(replays):
            mib = 10 * 2 ** (5 * number // replays)
            how = f"{whole.verb} in {mib} MiB more than it begins with"
            verb, less = whole.fresh(arena.folder), partial(_no_more, mib * MIB)
            outcome.count(*filter(None, [_wrong(whole, verb, how, less, (0, 1, 2, *LIBRARIES))]))
    outcome.note = (
        f"{refused} reads of the reader's child refused, {replays} replays; libraries of C that get no memory end the "
        "process themselves"
    )
    return outcome


def _no_more(memory: int) -> None:
    """No more memory from here on than this process has and so much."""
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + memory, resource.RLIM_INFINITY))


def _read_in(arena: Arena, tries: int) -> tuple[Outcome, int]:
    """Logs read by a child, and how often it was refused."""
    outcome, refused = Outcome(), 0
    for number in range(tries):
        name, mib = FORMATS[number % len(FORMATS)], 20 + 20 * (number // len(FORMATS))
        how = f"sample.{name} in {mib} MiB"
        reader = Reader()
        try:
            target = arena.folder / "recording.mcap"
            reader.record(LOGS / f"sample.{name}", target, limits=Limits(memory_bytes=mib * MIB))
            outcome.count()
        except UnreadableLogError as error:
            refused += 1
            right = "of memory: stopped" in str(error) and "\n" not in str(error) and not target.exists()
            outcome.count(*[f"{how}: {error}"] * (not right))
        finally:
            reader.close()
    return outcome, refused


ATTACKS = (
    Attack(
        "T4", "a call of the disk fails", "one line, exit code 1 or 2, the same command works after", 1800, 1, io_errors
    ),
    Attack("T5", "the disk is full", "as T4", 400, 1, full_disk),
    Attack("T6", "memory ends", "a log: refused in one line that says so; a replay: as T4", 150, 5, no_memory),
)
