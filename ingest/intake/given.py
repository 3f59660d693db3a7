"""What was given: log files, folders, patterns and archives become log files; what is no log in them is named.

A folder counts with all that lies in it, a pattern (`night/*.blf`) with all that it fits; hidden files and stores of
whyhot are left out. A file that was named itself is a log whatever it holds: its reader says why it is none.
"""

from __future__ import annotations

import glob
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from ingest.errors import IngestError, UnreadableLogError
from ingest.facts.sessions import natural
from ingest.facts.store import MARK
from ingest.formats import ANY_TEXT, is_table, recognise
from ingest.intake.archives import is_archive, unpacked
from ingest.intake.setup import kept_name
from ingest.log.database_files import is_database


@dataclass
class GivenLogs:
    """Log files, each with the argument that it came from; a line for each file of a folder, a pattern or an archive
    that is no log (`skipped`), and for each that may be one and cannot be had (`refused`)."""

    logs: dict[Path, Path] = field(default_factory=dict)
    skipped: list[str] = field(default_factory=list)
    refused: list[str] = field(default_factory=list)


@contextmanager
def opened(arguments: Sequence[Path]) -> Iterator[GivenLogs]:
    """The logs of all arguments, as long as they are worked with. Raises IngestError for one that is not there."""
    with tempfile.TemporaryDirectory(prefix="whyhot-") as folder:
        given = GivenLogs()
        for number, argument in enumerate(arguments):
            _add(given, argument, Path(folder) / str(number))
        yield given


def _add(given: GivenLogs, argument: Path, folder: Path) -> None:
    before = len(given.logs), len(given.refused)
    for number, path in enumerate(_files(argument)):
        for one in _members(given, path, folder / str(number)):
            why = None if one == argument else _no_log(one)
            if why:
                given.skipped.append(f"{why} Skipped.")
            else:
                given.logs[one] = argument
    if (len(given.logs), len(given.refused)) == before:
        given.refused.append(f"{argument}: holds no log: correct the path, or name the files.")


def _files(argument: Path) -> list[Path]:
    """The file that was named, or those of a folder, of those in it, or of a pattern; not those of a store."""
    if argument.is_file():
        return [argument]
    pattern = str(argument)
    if argument.is_dir():
        pattern = str(Path(glob.escape(pattern)) / "**")
    elif not glob.has_magic(pattern):
        raise IngestError(f"{argument}: there is no such file: correct the path.")
    found = [Path(path) for path in glob.iglob(pattern, recursive=True)]  # noqa: PTH207 (it may begin at the root)
    if not found:
        raise IngestError(f"{argument}: nothing fits this pattern: correct the path.")
    files = sorted((path for path in found if path.is_file()), key=lambda path: natural(str(path)))
    stores = {path.parent for path in files if path.name == MARK}
    return [path for path in files if stores.isdisjoint(path.parents)]


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
        if recognise(path) == ANY_TEXT and not is_table(path):
            what = (
                "describes signals of a bus: give it with --dbc" if is_database(path) else "is a text without a table"
            )
            return f"{kept_name(path)}: {what}."
    except UnreadableLogError as error:
        return str(error)
    except OSError as error:
        return f"{kept_name(path)}: cannot be opened ({error.strerror})."
    return None
