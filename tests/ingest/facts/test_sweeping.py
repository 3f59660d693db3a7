"""Only what lies in a store under the name of something forgotten is removed, whatever a forged event names."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

from ingest.facts.cited import cited, forgotten
from ingest.facts.durable import sha256_of
from ingest.facts.events import DecodeCompleted, FactRetracted, LogForgotten
from ingest.facts.standing import whole
from ingest.facts.store import Store
from ingest.facts.store_check import check
from ingest.facts.sweeping import sweep
from ingest.units.each import Workers
from made.events import decode, raw


def test_forged_names_of_decodes_and_files_lead_to_nothing_outside_the_store(tmp_path: Path) -> None:
    outside = tmp_path / "outside"
    outside.mkdir()
    (outside / "letter.txt").write_text("dear")
    with Store.open(tmp_path / "store", create=True) as store:
        sha256 = store.archive.seal(b"bytes")
        log = replace(raw("a.blf", b"bytes"), sha256=sha256)
        forged: list[DecodeCompleted] = [decode("../../outside", sha256), decode("d1", "another")]
        stream = f"file-{sha256}"
        back = FactRetracted(fact=stream, name="a.blf", why="x", rows=[whole(sha256)])
        gone = LogForgotten(raw=sha256, name="a.blf", size=5, why="it must go")
        seals = [log, replace(log, sha256="../../outside"), *forged, back, gone]
        store.ledger.append_all([(stream, event) for event in seals])
        events = store.ledger.events()
        assert not cited(events)
        assert check(store).damages == []
        assert sweep(store, forgotten(events)).files == 1
        assert not [*store.archive]
    assert (outside / "letter.txt").exists()


def test_workers_that_check_a_store_read_nothing_outside_it(tmp_path: Path) -> None:
    outside = tmp_path / "outside"
    outside.mkdir()
    (outside / "letter.txt").write_bytes(b"dear")
    with Store.open(tmp_path / "store", create=True) as store:
        sha256 = store.archive.seal(b"bytes")
        log = replace(raw("a.blf", b"bytes"), sha256=sha256)
        forged = replace(decode("../../outside", sha256), products={"letter.txt": sha256_of(outside / "letter.txt")})
        store.ledger.append_all([(f"file-{sha256}", event) for event in (log, forged)])
        alone, helped = check(store), check(store, workers=Workers(ThreadPoolExecutor))
    assert helped.damages == alone.damages
    assert ["it was forged" in one.says for one in alone.damages] == [True]
