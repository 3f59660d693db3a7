"""Archives: the logs in a zip file, and what gzip or zstd packed, each unpacked into a file of its own.

A file in an archive is called `S1.blf in night.zip`. Texts that are packed with gzip are no archives: their readers
unpack them. An archive that would unpack to far more than logs do is refused before it fills the disk.
"""

from __future__ import annotations

import errno
import gzip
import os
import re
import zipfile
import zlib
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path, PurePosixPath
from typing import Any

import pyarrow as pa

from ingest.errors import IngestError, UnreadableLogError
from ingest.formats import GZIP, head_of, is_text, most_unpacked

WORKBOOK = rb"\[Content_Types\]|_rels/|docProps/|xl/|customXml/|mimetype"  # how the first file in one is called
ZIP = re.compile(rb"PK(?:\x05\x06|\x03\x04.{26}(?!" + WORKBOOK + rb"))", re.DOTALL)
ZSTD = b"\x28\xb5\x2f\xfd"
BLOCK = 1 << 16  # bytes that are unpacked at once: at most so many are lost before a cut
MEMBERS = 10_000  # files in an archive, at most
LONGEST = 255  # bytes of a file's name, as file systems take it
DAMAGE = (zipfile.BadZipFile, zlib.error, pa.ArrowException, OSError, EOFError, ValueError, NotImplementedError)


def is_archive(path: Path) -> bool:
    """Whether a file is an archive, and neither a workbook nor a text that its reader unpacks."""
    with path.open("rb") as file:
        head = file.read(64)
    if head.startswith(GZIP):
        return not is_text(head_of(path))
    return head.startswith(ZSTD) or ZIP.match(head) is not None


def unpacked(path: Path, folder: Path) -> tuple[list[Path], list[str]]:
    """(the files of an archive, in its order; a line for each that is not, or not whole, among them). They lie in
    `folder`. Raises UnreadableLogError where nothing of the archive can be used, IngestError for a full disk."""
    files, lines = list[Path](), list[str]()
    left = most = most_unpacked(path.stat().st_size)
    try:
        for number, (name, opened) in enumerate(_members(path)):
            target = folder / str(number) / _called(name, path.name)
            target.parent.mkdir(parents=True)
            try:
                left -= _copy(opened, target, left)
            except DAMAGE as error:
                if getattr(error, "errno", None) == errno.ENOSPC:
                    raise IngestError(f"{path.name}: there is no room to unpack it in {folder}: make some.") from None
                lines.append(f"{target.name}: {_wrong(error, target)}")
            except RuntimeError:  # what zipfile raises for it
                lines.append(f"{target.name}: has a password. Unpack it first (7z x asks for it).")
            files += [target] if target.is_file() else []
            if left < 0 or number == MEMBERS:
                what = f"unpacks to more than {most:,} bytes" if left < 0 else f"holds over {MEMBERS:,} files"
                raise UnreadableLogError(f"{path.name}: {what}: nothing of it is used. Unpack the logs in it first.")
    except DAMAGE as error:
        raise UnreadableLogError(f"{path.name}: is no whole archive ({error}). Copy it again.") from None
    return files, lines


def _members(path: Path) -> Iterator[tuple[str, Callable[[], Any]]]:
    """(name, what opens it) of each file in an archive; hidden ones left out."""
    with path.open("rb") as file:
        magic = file.read(len(ZSTD))
    if magic.startswith(GZIP):
        yield path.stem, partial(gzip.open, path)
    elif magic == ZSTD:
        yield path.stem, lambda: pa.CompressedInputStream(pa.OSFile(str(path)), "zstd")
    else:
        with zipfile.ZipFile(path) as packed:
            for one in packed.infolist():
                place = PurePosixPath(one.filename.replace("\\", "/"))
                if not one.is_dir() and not any(part.startswith((".", "__MACOSX")) for part in place.parts):
                    yield place.name, partial(packed.open, one)


def _called(name: str, archive: str) -> str:
    """What a file in an archive is called; of names too long for a file system the ends."""
    called = f"{name} in {archive}"
    return called if len(os.fsencode(called)) <= LONGEST else f"{_end(name)} in {_end(archive)}"


def _end(name: str) -> str:
    """The last bytes of a name, where it takes more than half of the room."""
    data = os.fsencode(name)
    return name if len(data) <= LONGEST // 2 - 8 else f"…{data[8 - LONGEST // 2 :].decode('utf-8', 'ignore')}"


def _copy(opened: Callable[[], Any], target: Path, most: int) -> int:
    """Unpack a file; the bytes that it has, or a few more than `most` where it has more."""
    size = 0
    with opened() as source, target.open("wb") as file:
        while size <= most and (block := source.read1(BLOCK)):
            size += file.write(block)
    return size


def _wrong(error: BaseException, target: Path) -> str:
    """What is wrong with a file in an archive. Where its packed contents end early, what was unpacked is kept."""
    if isinstance(error, NotImplementedError):
        target.unlink(missing_ok=True)
        return "is packed in a way that is not read. Unpack it first."
    if isinstance(error, EOFError) or "Truncated" in str(error):
        return "was cut inside its packed contents: what comes before is used. Copy the archive again."
    target.unlink(missing_ok=True)
    if "too much memory" in str(error):  # of Zstandard, which looks back over 128 MiB
        return "is packed so that it takes too much memory to unpack. Unpack it first (unzstd --long=31)."
    return f"is damaged ({error}): nothing of it is used. Copy the archive again."
