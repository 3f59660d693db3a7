"""Text files of any size in whole lines, packed with gzip or not, in bounded memory."""

from __future__ import annotations

import gzip
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from ingest.errors import UnreadableLogError

BLOCK = 4 << 20  # bytes that are read at once
LONGEST_LINE = 1 << 20  # bytes
RATIO, ALWAYS = 200, 256 << 20  # a packed file may unpack to this many times its size, or to this many bytes
GZIP_MAGIC = b"\x1f\x8b"


@dataclass
class TextFile:
    """A text file. After `blocks()`, `ended` says why it ended early, `open_line` that no line feed ends it."""

    path: Path
    ended: str | None = None
    open_line: bool = False
    packed: bool = False

    def blocks(self) -> Iterator[bytes]:
        """Whole lines with their line feeds; only the last line of the file may lack it."""
        rest = b""
        for piece in self._pieces():
            lines, feed, tail = piece.rpartition(b"\n")
            if feed:
                yield rest + lines + feed
                rest = tail
            else:
                rest += piece
            if len(rest) > LONGEST_LINE:
                self.ended = f"holds a line longer than {LONGEST_LINE:,} bytes"
                return
        self.open_line = bool(rest)
        if rest:
            yield rest

    def _pieces(self) -> Iterator[bytes]:
        with self.path.open("rb") as file:
            self.packed = file.read(len(GZIP_MAGIC)) == GZIP_MAGIC
            file.seek(0)
            if self.packed:
                yield from self._unpacked(file)
            else:
                yield from iter(lambda: file.read(BLOCK), b"")

    def _unpacked(self, file: IO[bytes]) -> Iterator[bytes]:
        limit = max(ALWAYS, RATIO * self.path.stat().st_size)
        total, pieces = 0, gzip.GzipFile(fileobj=file)
        try:
            while piece := pieces.read1(BLOCK):
                total += len(piece)
                if total > limit:
                    self.ended = f"unpacks to more than {limit:,} bytes"
                    return
                yield piece
        except EOFError:
            self.ended = f"ends inside its packed contents at byte {self.path.stat().st_size:,}"
        except (gzip.BadGzipFile, zlib.error) as error:
            if total == 0 or "Not a gzipped file" in str(error):  # what follows the packed contents is no part of them
                self.ended = f"is damaged at byte {file.tell():,} (its packed contents: {error})"
                return
            raise UnreadableLogError(
                f"{self.path.name}: its packed contents are damaged ({error}), any line may be wrong: nothing of it is "
                "used. Copy the file again."
            ) from None
