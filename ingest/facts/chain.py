"""What makes a changed byte show: canonical JSON, the digest of an event and the Merkle tree over all rows.

Canonical JSON has its keys in code-point order, no spaces, UTF-8, numbers as Python writes them, and neither NaN nor
infinity. The tree hashes as RFC 6962 section 2.1 does (a leaf is SHA-256 of 0x00 and the entry, a node of 0x01 and both
sides; doi:10.17487/RFC6962), so that neither can pass for the other.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from ingest.errors import LedgerError


def canonical(value: Any) -> bytes:
    """The one JSON text of `value`, as bytes. Raises LedgerError for what JSON or UTF-8 cannot hold."""
    try:
        text = json.dumps(value, sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
        return text.encode()
    except (ValueError, TypeError) as error:
        raise LedgerError(
            f"a fact cannot be stored as JSON ({error}): leave that value out, or say it as text"
        ) from None


def digest(stream: str, version: int, topic: str, rest: bytes) -> str:
    """SHA-256 (hex) of an event over every stored column but the position, which the Merkle tree holds.

    `rest`: the stored state without its member `digest`. A JSON array ends itself: no two events give the same bytes.
    """
    return hashlib.sha256(canonical([stream, version, topic]) + rest).hexdigest()


def entry(position: int, stream: str, version: int, topic: str, state: bytes) -> bytes:
    """A row as one entry of the tree, framed as in `digest`."""
    return canonical([position, stream, version, topic]) + state


@dataclass(frozen=True)
class Head:
    """A ledger in one line, proof where it is kept elsewhere: Merkle root (hex) over all rows up to `position`."""

    position: int
    root: str

    def __str__(self) -> str:
        return f"{self.position}:{self.root}"


class Tree:
    """A Merkle tree that only grows; keeps one hash for each whole subtree (log2 of the number of entries)."""

    def __init__(self, whole: Iterable[tuple[int, str]] = ()) -> None:
        self._whole = [(height, bytes.fromhex(node)) for height, node in whole]  # left to right, heights falling

    @property
    def whole(self) -> tuple[tuple[int, str], ...]:
        """(height, hash) of each whole subtree: a tree made of these grows as this one does."""
        return tuple((height, node.hex()) for height, node in self._whole)

    def add(self, entry: bytes) -> None:
        """Add `entry` on the right."""
        height, node = 0, hashlib.sha256(b"\x00" + entry).digest()
        while self._whole and self._whole[-1][0] == height:
            node = _node(self._whole.pop()[1], node)
            height += 1
        self._whole.append((height, node))

    @property
    def root(self) -> str:
        """The Merkle tree hash (hex); SHA-256 of nothing where the tree is empty."""
        if not self._whole:
            return hashlib.sha256(b"").hexdigest()
        node = self._whole[-1][1]
        for _, left in reversed(self._whole[:-1]):
            node = _node(left, node)
        return node.hex()


def _node(left: bytes, right: bytes) -> bytes:
    return hashlib.sha256(b"\x01" + left + right).digest()
