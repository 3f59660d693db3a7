"""The store as it was at an event or a time, to ask anything of: whatever is written to it is thrown away."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from ingest.facts.cited import cited
from ingest.facts.events import DecodeCompleted
from ingest.facts.ledger_row import Recorded
from ingest.facts.store import Store


@contextmanager
def store_as_of(folder: Path, point: str) -> Iterator[Store]:
    """The store in `folder` with its ledger up to `point` (number of an event, or ISO 8601 time), open for writing in a
    temporary folder of its own, with links to sealed bytes and decoded files.

    Raises as `Store.open` and `Ledger.events`.
    """
    with TemporaryDirectory(prefix="whyhot-as-of-") as made:
        with Store.open(folder) as store:
            recorded = store.ledger.events(as_of=point)
            rows = [*store.ledger.rows(stop=recorded[-1].position)] if recorded else []
            gone = store.forgotten
        with Store.open(Path(made) / "store", create=True) as then:
            then.ledger.take_over(rows)
            then.forgotten = gone  # there is no way back to bytes
            _link(store, then, recorded)
            yield then


def _link(now: Store, then: Store, recorded: Sequence[Recorded]) -> None:
    """Let `then` find what the facts of then cite; what is damaged or missing there is so there too."""
    for sha256 in cited(recorded):
        target = then.archive.path(sha256)
        target.parent.mkdir(exist_ok=True)
        target.symlink_to(now.archive.path(sha256).absolute())
    decodes = {one.event.decode for one in recorded if isinstance(one.event, DecodeCompleted)}
    for decode in decodes:
        if (made := now.decoded(decode)).is_dir():
            then.decoded(decode).symlink_to(made.absolute())
