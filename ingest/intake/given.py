"""What was given: log files, folders, patterns and archives become log files; what is no log in them is named.

A folder counts with all that lies in it, a pattern (`night/*.blf`) with all that it fits; hidden files, locks of
Office and stores of whyhot are left out. A file that was named itself is a log whatever it holds: its reader says why
it is none. Signal databases are given in the same ways.
"""

from __future__ import annotations

import glob
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from ingest.errors import IngestError, UnreadableLogError
from ingest.facts.durable import scratch
from ingest.facts.sessions import natural
from ingest.facts.store import MARK
from ingest.formats import ANY_TEXT, no_table, recognise
from ingest.intake.archives import is_archive, unpacked
from ingest.intake.setup import kept_name
from ingest.log.database_files import is_database

TABLES = (".csv", ".tsv")  # so a table is called, whatever it holds
LOCK = "~$"  # so Office calls what it keeps beside a file that is open
DATABASES = (".dbc", ".kcd", ".sym", ".arxml")  # so a database is called, whatever it holds


@dataclass
class GivenLogs:
    """Log files, each with the argument that it came from; a line for each file of a folder, a pattern or an archive
    that is no log (`skipped`), and for each that may be one and cannot be had (`refused`)."""

    logs: dict[Path, Path] = field(default_factory=dict)
    skipped: list[str] = field(default_factory=list)
    refused: list[str] = field(default_factory=list)


@contextmanager
def opened(arguments: Sequence[Path], databases: Sequence[Path] = ()) -> Iterator[GivenLogs]:
    """The logs of all arguments, as long as they are worked with. `databases`: files among them that were given as
    such, and need not be named. Raises IngestError for an argument that is not there."""
    known = {path.resolve() for path in databases}
    with scratch() as folder:
        given = GivenLogs()
        for number, argument in enumerate(arguments):
            _add(given, argument, folder / str(number), known)
        yield given


def databases_given(arguments: Sequence[Path]) -> list[Path]:
    """The signal databases that `--dbc` names: files, and what is one in folders and patterns.

    Raises IngestError where something is not there, or a folder or pattern holds none.
    """
    found: dict[Path, None] = {}
    for argument in arguments:
        try:
            files = [argument] if argument.is_file() else databases_in(argument)
        except IngestError as error:
            raise IngestError(f"--dbc {error}") from None
        if not files:
            raise IngestError(f"--dbc {argument}: holds no signal database: correct the path, or name the files.")
        found |= dict.fromkeys(files)
    return list(found)


def databases_in(argument: Path) -> list[Path]:
    """The signal databases in a folder, or among the files that fit a pattern. Raises IngestError where it is not
    there."""
    files = [path for path in files_in(argument) if path.exists()]
    return [path for path in files if path.suffix.lower() in DATABASES or _looks_like_a_database(path)]


def _looks_like_a_database(path: Path) -> bool:
    try:
        return recognise(path) == ANY_TEXT and no_table(path) is not None and is_database(path)
    except (UnreadableLogError, OSError):
        return False


def _add(given: GivenLogs, argument: Path, folder: Path, known: Collection[Path]) -> None:
    before = len(given.logs), len(given.refused)
    for number, path in enumerate(files_in(argument)):
        for one in _members(given, path, folder / str(number)):
            why = None if one == argument else _no_log(one)
            if why is None:
                given.logs[one] = argument
            elif one.resolve() not in known:
                given.skipped.append(f"{why} Skipped.")
    if (len(given.logs), len(given.refused)) == before:
        given.refused.append(f"{argument}: holds no log: correct the path, or name the files.")


def files_in(argument: Path) -> list[Path]:
    """The file that was named, or those of a folder, of those in it, or of a pattern; not those of a store. Raises
    IngestError where nothing is there."""
    if argument.is_file():
        return [argument]
    pattern = str(argument)
    if argument.is_dir():
        pattern = str(Path(glob.escape(pattern)) / "**")
    elif not glob.has_magic(pattern):
        raise IngestError(f"{argument}: there is no such file: correct the path.")
    found = [Path(path) for path in glob.iglob(pattern, recursive=True)]  # noqa: PTH207 (it may begin at the root)
    if not found and not argument.is_dir():
        raise IngestError(f"{argument}: nothing fits this pattern: correct the path.")
    there = (path for path in found if path.is_file() or not path.exists())  # a link that leads nowhere is named
    files = sorted(there, key=lambda path: natural(str(path)))
    stores = {path.parent for path in files if path.name == MARK}
    return [path for path in files if stores.isdisjoint(path.parents) and not path.name.startswith(LOCK)]


def _members(given: GivenLogs, path: Path, folder: Path) -> list[Path]:
    """The files of an archive, unpacked into `folder`; any other file as it is."""
    try:
        if not is_archive(path):
            return [path]
        files, lines = unpacked(path, folder)
    except OSError:  # the one that reads it says so
        return [path]
    except UnreadableLogError as error:
        files, lines = [], [str(error)]
    given.refused += lines
    return files


def _no_log(path: Path) -> str | None:
    """Why a file is no log; None where it may be one."""
    try:
        if is_archive(path):
            return f"{kept_name(path)}: is an archive in an archive. Unpack it first."
        if recognise(path) == ANY_TEXT and (why := no_table(path)):
            if is_database(path):
                return f"{kept_name(path)}: describes signals of a bus: give it with --dbc."
            named = path.suffix.lower() in TABLES or why.startswith("line 1 holds numbers")  # and no prose
            what = f": {why}" if named else "."
            return f"{kept_name(path)}: is a text without a table{what}"
    except UnreadableLogError as error:
        return str(error)
    except OSError as error:
        return f"{kept_name(path)}: cannot be opened ({error.strerror})."
    return None
