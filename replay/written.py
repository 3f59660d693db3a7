"""Files that a command was told to write: whole, under their names, or not at all."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from uuid import uuid4


@contextmanager
def written(target: Path) -> Iterator[Path]:
    """A path beside `target` to write to, which becomes `target` once all is written: who reads meanwhile has the file
    that was there, and nothing stays of one that is not finished. A folder that is not there is made.

    What is there and is no file of its own (a link, a pipe, /dev/stdout) is written to itself, since another file would
    take its place.
    """
    target.parent.mkdir(parents=True, exist_ok=True)
    if target.is_symlink() or (target.exists() and not target.is_file()):
        yield target
        return
    part = target.with_name(f".{target.name[:64]}.{uuid4().hex[:8]}.part")
    try:
        yield part
        part.replace(target)
    except BaseException as error:
        with suppress(OSError):  # the first error is the one to say
            part.unlink(missing_ok=True)
        if isinstance(error, OSError) and error.filename == str(part):
            error.filename = str(target)  # the name that was given
        raise


def write(target: Path, text: str) -> None:
    """`text` as the file `target`, by `written`."""
    with written(target) as part:
        part.write_bytes(text.encode(errors="backslashreplace"))
