"""The store as it was at an event or a time, to ask anything of: whatever is written to it is thrown away."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ingest.facts.durable import scratch
from ingest.facts.store import Store


@contextmanager
def store_as_of(folder: Path, point: str) -> Iterator[Store]:
    """The store in `folder` with its ledger up to `point` (number of an event, or ISO 8601 time), open for writing in a
    temporary folder of its own; sealed bytes and decoded files are read where they lie.

    Raises as `Store.open` and `Ledger.events`.
    """
    with scratch() as made:
        with Store.open(folder) as store:
            recorded = store.ledger.events(as_of=point)
            rows = [*store.ledger.rows(stop=recorded[-1].position)] if recorded else []
            gone = store.forgotten
        with Store.open(made / "store", create=True) as then:
            then.ledger.take_over(rows)
            then.forgotten = gone  # there is no way back to bytes
            then.read_behind(store)
            yield then
