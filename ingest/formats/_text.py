"""Text files of any size in whole lines, packed with gzip or not, other encodings made UTF-8, in bounded memory."""

from __future__ import annotations

import codecs
import gzip
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import IO

from ingest.errors import UnreadableLogError
from ingest.formats import GZIP, most_unpacked
from ingest.texts.encodings import encoding_of

BLOCK = 4 << 20  # bytes that are read at once
LONGEST_LINE = 1 << 20  # bytes; of a longer one the first bytes are given, and a NUL for the rest of it
KEPT = 64


@dataclass
class TextFile:
    """A text file. After `blocks()`, `ended` says why it ended early, `open_line` that no line feed ends it.

    `as_written`: blocks are not made UTF-8, so that their bytes are counted as in the file; but for UTF-16, in whose
    bytes lines do not show."""

    path: Path
    as_written: bool = False
    ended: str | None = None
    open_line: bool = False
    packed: bool = False
    encoding: str = "utf-8"  # that it was made UTF-8 from; what is not UTF-8 is taken for cp1252 by whoever decodes it
    mark: int = 0  # bytes before the text
    left_out: int = 0  # bytes of overlong lines above this block

    def blocks(self) -> Iterator[bytes]:
        """Whole lines with their line feeds; only the last line of the file may lack it."""
        rest, over = b"", 0  # what is open of a line, and how many bytes of it are left out
        for piece in self._in_lines():
            if over:
                end, feed, piece = piece.partition(b"\n")
                over += len(end)
                if not feed:
                    continue
                yield rest + feed
                self.left_out += over - 1
                rest, over = b"", 0
            lines, feed, tail = piece.rpartition(b"\n")
            if feed:
                yield rest + lines + feed
            rest = tail if feed else rest + tail
            if len(rest) > LONGEST_LINE:
                rest, over = rest[:KEPT] + b"\0", len(rest) - KEPT
        self.open_line = bool(rest)
        if rest:
            yield rest

    def _in_lines(self) -> Iterator[bytes]:
        """The pieces, a line feed at the end of each line, as "CSV (Macintosh)" of Excel has none."""
        pieces = self._plain()
        first = next(pieces, b"")
        old = b"\r" in first and b"\n" not in first
        for piece in chain([first] if first else [], pieces):
            yield piece.replace(b"\r", b"\n") if old else piece

    def _plain(self) -> Iterator[bytes]:
        """The pieces of the file; of one in another encoding (`encoding_of`) as UTF-8."""
        pieces = self._pieces()
        first = next(pieces, b"")
        if first.startswith(codecs.BOM_UTF8):
            first, self.mark = first.removeprefix(codecs.BOM_UTF8), len(codecs.BOM_UTF8)
        encoding = encoding_of(first)
        if encoding is None or (self.as_written and not encoding.startswith("utf-16")):
            yield from chain([first] if first else [], pieces)
            return
        self.encoding = encoding.removesuffix("-le").removesuffix("-be")
        decoder = codecs.getincrementaldecoder(encoding)(errors="replace")
        for piece in chain([first], pieces):
            yield decoder.decode(piece).encode(errors="replace")
        yield decoder.decode(b"", final=True).encode()

    def _pieces(self) -> Iterator[bytes]:
        with self.path.open("rb") as file:
            self.packed = file.read(len(GZIP)) == GZIP
            file.seek(0)
            if self.packed:
                yield from self._unpacked(file)
            else:
                yield from iter(lambda: file.read(BLOCK), b"")

    def _unpacked(self, file: IO[bytes]) -> Iterator[bytes]:
        limit = most_unpacked(self.path.stat().st_size)
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


def decoded(block: bytes) -> str:
    """A block as text: UTF-8, or cp1252 in lines that are not UTF-8."""
    try:
        return block.decode("utf-8-sig")
    except UnicodeDecodeError:
        return "\n".join(map(_decoded_line, block.removeprefix(codecs.BOM_UTF8).split(b"\n")))


def _decoded_line(line: bytes) -> str:
    try:
        return line.decode()
    except UnicodeDecodeError:
        return line.decode("cp1252", errors="replace")


def place_of(path: Path, line: int) -> str:
    """Where a line (from 1) of a text file stands: "line 7, byte 204", of a packed one "line 7, unpacked +204".

    In UTF-16, which is made another text on the way, "line 7".
    """
    text, lines, begun = TextFile(path, as_written=True), 1, 0  # the line that a block begins with, and its byte
    for block in text.blocks():
        feeds = block.count(b"\n")
        if line < lines + feeds or text.open_line:
            break
        lines, begun = lines + feeds, begun + len(block)
    if text.encoding != "utf-8":
        return f"line {line:,}"
    at = 0
    for _ in range(line - lines):
        at = block.index(b"\n", at) + 1
    return f"line {line:,}, {'unpacked +' if text.packed else 'byte '}{text.mark + text.left_out + begun + at:,}"
