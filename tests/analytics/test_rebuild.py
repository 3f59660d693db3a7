"""Nothing but ledger and archive is precious."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from analytics import warehouse
from analytics.rebuild import rebuild
from ingest.facts.events import DecodeCompleted
from ingest.facts.facts import Facts
from ingest.facts.store import Store
from made.insulation_logs import decoded_anew
from made.places import on_disk


class Redecode:
    """Stands in for the decoder: keeps a copy of decoded/ and brings it back. `differs`: logs of which other bytes are
    made than before."""

    def __init__(self, store: Store, copy: Path) -> None:
        self.copy, self.differs = copy, list[str]()
        shutil.copytree(store.folder / "decoded", copy)

    def __call__(self, store: Store, facts: Facts) -> list[str]:
        shutil.rmtree(store.folder / "decoded", ignore_errors=True)
        shutil.copytree(self.copy, store.folder / "decoded")
        for raw in self.differs:
            decoded_anew(store, raw)
        return list(facts.decodes)


@pytest.fixture
def redecode(store: Store, tmp_path: Path) -> Iterator[Redecode]:
    yield Redecode(store, tmp_path / "copy")


def digests(store: Store) -> dict[str, str]:
    with warehouse.refresh(store) as opened:
        return warehouse.digest(opened.connection)


def test_a_rebuild_brings_back_what_was_there(store: Store, redecode: Redecode) -> None:
    before = digests(store)
    done = rebuild(store, redecode, verify=True)
    assert (done.products, done.views, done.differences, done.notes) == (3, len(warehouse.VIEWS), (), ())
    assert digests(store) == before


def test_deleted_projections_come_back_equal_to_what_the_ledger_names(store: Store, redecode: Redecode) -> None:
    before = digests(store)
    shutil.rmtree(store.folder / "decoded")
    (store.folder / "warehouse.duckdb").unlink()
    done = rebuild(store, redecode, verify=True)
    assert done.differences == ()
    assert done.notes[0].startswith("views were not compared, they could not be read before: ")
    assert digests(store) == before


def test_a_product_that_differs_is_named_and_so_are_its_views(store: Store, redecode: Redecode) -> None:
    path = redecode.copy / "d2" / "rows.parquet"
    pq.write_table(pq.read_table(path).slice(0, 9), path)
    redecode.differs = ["2" * 64]
    done = rebuild(store, redecode, verify=True)
    product, *views = done.differences
    assert product.startswith(
        f"{on_disk(store.decoded('d2')) / 'rows.parquet'}: differs from what its event names (sha256 "
    )
    assert views == [f"view {view}: holds other rows than before" for view in ("samples", "events")]


def test_a_product_that_is_not_made_again_is_named(store: Store, redecode: Redecode) -> None:
    stream, last = f"file-{'2' * 64}", store.ledger.events(DecodeCompleted, stream=f"file-{'2' * 64}")[-1].event
    more = {"products": {**vars(last)["products"], "recording.mcap": "0" * 64}}
    store.ledger.append(stream, DecodeCompleted(**{**vars(last), **more}))
    done = rebuild(store, redecode, verify=True)
    assert done.differences == (f"{on_disk(store.decoded('d2')) / 'recording.mcap'}: was not made again",)


def test_without_verify_nothing_is_compared(store: Store, redecode: Redecode) -> None:
    path = redecode.copy / "d2" / "rows.parquet"
    pq.write_table(pq.read_table(path).slice(0, 9), path)
    redecode.differs = ["2" * 64]
    assert rebuild(store, redecode).differences == ()
