"""Projections made again from nothing: decoded files and warehouse."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import TYPE_CHECKING

from analytics import partitions, warehouse
from analytics.errors import AnalyticsError
from ingest.facts import facts as folding
from ingest.facts.durable import sha256_of
from ingest.texts.names import handle

if TYPE_CHECKING:
    from ingest.facts.facts import Facts
    from ingest.facts.store import Store


@dataclass(frozen=True)
class Rebuilt:
    """What was made: number of products (recordings and Parquet files) and of views. `differences`: a line each."""

    products: int
    views: int
    differences: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


def rebuild(store: Store, redecode: Callable[[Store, Facts], Collection[str]], verify: bool = False) -> Rebuilt:
    """Make decoded/ (by `redecode`, which returns the decodes that it made) and the warehouse again, from ledger and
    archive alone.

    With `verify` every product is compared with the SHA-256 that its event names, and every view with what it held
    before, where that could still be read. Raises what `redecode` and `warehouse.refresh` raise.
    """
    before, notes = _before(store) if verify else ({}, ())
    facts = folding.at(store.ledger)
    made_again = redecode(store, facts)
    named = {(key, file): sha256 for key in made_again for file, sha256 in facts.decodes[key].products.items()}
    (store.folder / warehouse.FILE).unlink(missing_ok=True)
    shutil.rmtree(store.folder / partitions.FOLDER, ignore_errors=True)
    with warehouse.refresh(store) as made:
        after = warehouse.digest(made.connection) if verify else {}
        changed = [made.left_out] if made.left_out else []
    changed += [f"view {view}: holds other rows than before" for view in before if before[view] != after[view]]
    return Rebuilt(
        products=len(named),
        views=len(warehouse.VIEWS),
        differences=(*(_differences(store, named) if verify else ()), *changed),
        notes=notes,
    )


def _before(store: Store) -> tuple[dict[str, str], tuple[str, ...]]:
    """What the views hold now; nothing, and why, where they cannot be read."""
    try:
        with warehouse.refresh(store) as opened:
            if opened.left_out:
                return {}, (f"views were not compared, they could not be read before: {opened.left_out}",)
            return warehouse.digest(opened.connection), opened.notes
    except (AnalyticsError, OSError) as error:
        return {}, (f"views were not compared, they could not be read before: {error}",)


def _differences(store: Store, named: dict[tuple[str, str], str]) -> list[str]:
    """A line for each product, (decode, file) -> SHA-256, that is not as its event says."""
    found = []
    for (decode, file), sha256 in named.items():
        path = store.decoded(decode) / file
        if not path.is_file():
            found.append(f"{path}: was not made again")
        elif sha256_of(path) != sha256:
            found.append(f"{path}: differs from what its event names (sha256 {handle(sha256)}...)")
    return found
