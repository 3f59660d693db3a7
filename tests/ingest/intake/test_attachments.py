"""Photographs and other files with a finding: sealed once, on the specimen's time line, and checked like every sealed
byte."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from ingest.errors import IngestError, UnknownSessionError
from ingest.facts import facts as ledger_facts
from ingest.facts.events import InspectionRecorded, SessionRegrouped
from ingest.facts.store import Store
from ingest.intake.attachments import Finding, attach, unknown_specimen
from made.events import session
from made.lines_of_damage import damage
from made.places import on_disk

CRACK = Finding("stator-07", "resin cracked at slot 3", happened="2025-12-24T09:00:00+01:00")


@pytest.fixture
def store(tmp_path: Path) -> Iterator[Store]:
    with Store.open(tmp_path / "store", create=True) as made:
        for number, specimen in (("aa", "stator-07"), ("bb", "stator-08")):
            made.ledger.append(f"session-{number}", replace(session(number, f"oven_{number}"), specimen=specimen))
        yield made


@pytest.fixture
def photo(tmp_path: Path) -> Path:
    path = tmp_path / "end.JPG"
    path.write_bytes(b"\xff\xd8 a picture")
    return path


def recorded(store: Store) -> list[InspectionRecorded]:
    found = [one.event for one in store.ledger.events(InspectionRecorded)]
    return [one for one in found if isinstance(one, InspectionRecorded)]


def test_the_file_is_sealed_with_specimen_time_and_finding(store: Store, photo: Path) -> None:
    (done,) = attach(store, [photo], CRACK)
    assert recorded(store) == [done.event]
    assert not done.known
    assert store.archive.read(done.event.sha256) == photo.read_bytes()
    said = (done.event.name, done.event.media_type, done.event.size, done.event.specimen, done.event.finding)
    assert said == ("end.JPG", "image/jpeg", 12, "stator-07", "resin cracked at slot 3")
    assert done.event.happened == "2025-12-24T08:00:00.000000Z"
    (row,) = store.ledger.events(InspectionRecorded)
    assert row.happened == done.event.happened


def test_the_same_again_writes_nothing(store: Store, photo: Path) -> None:
    first, again = attach(store, [photo, photo], CRACK), attach(store, [photo], CRACK)
    assert [one.known for one in (*first, *again)] == [False, True]
    assert recorded(store) == [again[0].event]


@pytest.mark.parametrize(
    "other",
    [
        replace(CRACK, says="no crack at slot 4"),
        replace(CRACK, specimen="stator-09"),
        replace(CRACK, happened="2025-12-25"),
        replace(CRACK, happened=None, session="aa"),
    ],
)
def test_the_same_bytes_with_another_finding_are_a_second_fact(store: Store, photo: Path, other: Finding) -> None:
    attach(store, [photo], CRACK)
    (done,) = attach(store, [photo], other)
    assert not done.known
    assert len({one.inspection for one in recorded(store)}) == 2
    assert len({one.sha256 for one in recorded(store)}) == 1


def test_a_session_is_found_by_name_and_follows_the_one_that_it_became_part_of(store: Store, photo: Path) -> None:
    after = Finding("stator-07", "darker than before", session="oven_aa")
    (done,) = attach(store, [photo], after)
    assert (done.event.session, done.event.happened) == ("aa", None)
    store.ledger.append("session-cc", replace(session("cc", "oven_aa"), specimen="stator-07"))
    store.ledger.append("session-aa", SessionRegrouped(session="aa", into="cc", why="a late file joined"))
    (kept,) = ledger_facts.at(store.ledger).inspections.values()
    assert kept == replace(done.event, session="cc")
    assert attach(store, [photo], after)[0].known


def test_a_session_of_another_specimen_is_refused_and_nothing_is_kept(store: Store, photo: Path) -> None:
    with pytest.raises(UnknownSessionError, match=r'session oven_bb: is of specimen "stator-08", not "stator-07"'):
        attach(store, [photo], Finding("stator-07", "crack", session="bb"))
    assert recorded(store) == [] and list(store.archive) == []


@pytest.mark.parametrize(
    ("finding", "line"),
    [
        (
            replace(CRACK, says=" "),
            '--finding: says nothing: write it in words, as --finding "resin cracked at slot 3"',
        ),
        (replace(CRACK, specimen=""), "--specimen: says nothing: write it in words, as --specimen stator-07"),
        (replace(CRACK, happened="Christmas"), '--when "Christmas": is no time: write it as 2025-12-24T08:00:00Z'),
    ],
)
def test_what_says_nothing_is_refused(store: Store, photo: Path, finding: Finding, line: str) -> None:
    with pytest.raises(IngestError) as refused:
        attach(store, [photo], finding)
    assert str(refused.value) == line
    assert list(store.archive) == []


def test_a_missing_or_empty_file_is_refused_before_anything_is_kept(store: Store, photo: Path) -> None:
    empty = photo.with_name("empty.png")
    empty.touch()
    for bad, why in ((photo.with_name("none.png"), "there is no such file"), (empty, r"is empty \(0 bytes\)")):
        with pytest.raises(IngestError, match=why):
            attach(store, [photo, bad], CRACK)
    assert list(store.archive) == []


def test_a_file_of_no_known_kind_is_kept_all_the_same(store: Store, photo: Path) -> None:
    scan = photo.with_name("scan.is2")
    scan.write_bytes(b"thermogram")
    assert attach(store, [scan], CRACK)[0].event.media_type == "application/octet-stream"


def test_verify_names_an_attachment_that_is_lost_or_changed_and_attaching_it_again_mends_it(
    store: Store, photo: Path
) -> None:
    (done,) = attach(store, [photo], CRACK)
    assert damage(store) == []
    path = on_disk(store.archive.path(done.event.sha256))
    path.chmod(0o644)
    path.write_bytes(b"another picture")
    (line,) = damage(store)
    assert "is damaged" in line and "end.JPG of specimen stator-07" in line
    path.unlink()
    (line,) = damage(store, read=False)
    assert "is missing" in line and "end.JPG of specimen stator-07" in line
    attach(store, [photo], CRACK)
    assert damage(store) == []


def test_a_specimen_of_no_session_is_pointed_out_with_the_nearest(store: Store) -> None:
    facts = ledger_facts.at(store.ledger)
    assert unknown_specimen(facts, "stator-07") is None
    assert unknown_specimen(facts, "stator_07") == (
        'specimen "stator_07": no session of it is in this store yet. Nearest: stator-07.'
    )
