"""A machine that refuses: a call of the disk that fails, a disk that is full, memory that ends.

A command then ends with one line and no traceback, its store verifies with nothing of before changed, and the same
command works once the machine is well.
"""

from __future__ import annotations

import errno
import os
import resource
import signal
from collections.abc import Callable, Iterator
from functools import partial
from itertools import product

from benchmarks.attack import children
from benchmarks.attack.children import Verb
from benchmarks.attack.kills import Whole, wholes
from benchmarks.attack.outcome import Arena, Attack, Outcome
from ingest.errors import UnreadableLogError
from ingest.log.reading import MIB, Limits, Reader
from made.places import LOGS

ERRORS = (errno.ENOSPC, errno.EDQUOT, errno.EIO, errno.EACCES, errno.EMFILE, errno.ESTALE)
WAYS = (  # a call fails, and whether all after it fail too; but with EACCES Python's `tempfile` would try without end
    *((error, False) for error in ERRORS),
    *((error, True) for error in ERRORS if error != errno.EACCES),
)
FORMATS = ("blf", "asc", "mf4", "tdms", "csv")
TRACEBACK = ("Traceback", "Exception ignored")


def _refuse(number: int, name: str) -> None:
    raise OSError(number, os.strerror(number), name)


def _wrong(whole: Whole, verb: Verb, how: str, before: Callable[[], object]) -> str:
    """What is wrong with a command that met a fault, and with the same command after it."""
    code, said = verb.ended(before)
    if code not in (0, 1, 2) or any(word in said for word in TRACEBACK):
        return f"{how}: exit code {code}: {said[-300:]}"
    if code == 2 and len([line for line in said.splitlines() if "replaced by the true bytes" not in line]) != 1:
        return f"{how}: more than one line: {said[-300:]}"
    return whole.wrong(verb, how, said)


def io_errors(arena: Arena) -> Outcome:
    """T4: a change of a disk, or a file opened or read, fails, once or from then on; half of each."""
    outcome, chance = Outcome(), arena.chance
    for whole, tries in _shared(arena, wholes(arena)):
        for fail_at, calls in ((children.at_change, whole.changes), (children.at_read, whole.reads)):
            ways = list(product(range(calls), WAYS))
            for number, (error, on) in chance.sample(ways, min(-(-tries // 2), len(ways))):
                call = f"{fail_at.__name__.removeprefix('at_')} {number}{' and all after it' if on else ''}"
                before = partial(fail_at, number, partial(_refuse, error), on)
                how = f"{whole.verb}, {errno.errorcode[error]} at {call}"
                outcome.count(*filter(None, [_wrong(whole, whole.fresh(arena.folder), how, before)]))
    return outcome


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
    """T6: the child that reads a log has less and less memory."""
    outcome, refused = Outcome(), 0
    for number in range(arena.tries):
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
    outcome.note = f"the reader's child; {refused} refused; a replay was not tried"
    return outcome


ATTACKS = (
    Attack(
        "T4", "a call of the disk fails", "one line, exit code 1 or 2, the same command works after", 1800, 1, io_errors
    ),
    Attack("T5", "the disk is full", "as T4", 200, 1, full_disk),
    Attack("T6", "memory ends", "refused in one line that says so", 150, 5, no_memory),
)
