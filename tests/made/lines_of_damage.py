"""The damage of a store as lines, for the tests of what keeps and moves one."""

from __future__ import annotations

from ingest.facts.chain import Head
from ingest.facts.store import Store
from ingest.facts.store_check import check


def damage(store: Store, read: bool = True, since: Head | None = None) -> list[str]:
    return [one.says for one in check(store, read, since).damages]
