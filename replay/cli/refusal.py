"""The one line of an error that a file, a flag or the machine caused."""

from __future__ import annotations

import argparse
import errno

from replay.cli.answer import store_folder

# By name, so that a refusal is worded without importing the package that raised it (analytics may not be there).
ROOTS = ("IngestError", "TwinError", "AnalyticsError", "ReplayError")
# Through which files and ledgers are read and written.
LIBRARIES = ("pyarrow", "duckdb", "_duckdb", "sqlite3", "eventsourcing", "psycopg")
NO_THREAD = "can't start new thread"  # Python's words where there is no memory for one
FULL = (errno.ENOSPC, errno.EDQUOT)
AGAIN = "see that the disk, and the network that it is on, are well, then run it again; `whyhot verify --read` checks"


def refusal(error: Exception, args: argparse.Namespace) -> str | None:
    """The one line of `error`; None for a defect of ours."""
    if any(base.__name__ in ROOTS for base in type(error).__mro__):
        then = f"as of {point}: " if (point := getattr(args, "as_of", None)) else ""
        line = " ".join(str(error).splitlines())
        return line if line.startswith("as of ") else then + line  # what is not there may be there by now
    if isinstance(error, ImportError) and error.name is not None:
        from whyhot.installation import ADVICE

        missing = error.name.partition(".")[0]
        return f"whyhot {args.verb} needs the package {missing}, which is missing here or another's: {ADVICE}."
    where = str(store_folder(args))
    if isinstance(error, OSError):
        return of_machine(error, where)
    if type(error).__module__.partition(".")[0] in LIBRARIES:
        return f"{where}: {_first_line(error)}: {AGAIN}."
    if isinstance(error, MemoryError) or str(error) == NO_THREAD:
        return f"whyhot {args.verb}: there is too little memory: close other programs, or give it less at once."
    return None


def of_machine(error: OSError, where: str) -> str:
    """What the machine refused, in one line; `where`: what is named if the error names no file."""
    named = where if error.filename is None else str(error.filename)
    if error.errno in FULL or "No space left" in str(error):
        return f"{where}: the disk is full: nothing half-written was kept. Free some space and run it again."
    if error.errno in (errno.EMFILE, errno.ENFILE):
        return f"{named}: too many files are open: close programs or allow more (ulimit -n 4096), then run it again."
    if error.errno in (errno.EIO, errno.ESTALE):
        return f"{named}: {(error.strerror or 'cannot be read').lower()}: {AGAIN}."
    if error.filename is not None:
        return f"{named}: {(error.strerror or 'cannot be used').lower()}. Check the path and its permissions."
    return f"{where}: {_first_line(error)}: {AGAIN}."


def _first_line(error: Exception) -> str:
    said = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
    return (said.splitlines() or [type(error).__name__])[0][:300].rstrip(".")
