"""Stores that earlier versions wrote: read for ever, and never written anew."""

from __future__ import annotations

import json
import shutil
import tarfile
from pathlib import Path
from typing import ClassVar

import pytest

from ingest.facts import events, facts
from ingest.facts.events import EVENTS, Event, RawFileSealed
from ingest.facts.store import Store
from ingest.intake import upgrade
from ingest.log import decode
from made import can_bench
from made.events import raw
from made.every_event import STORES as FOLDER
from made.every_event import said
from made.forged import change, resealed, stored
from replay.cli import main

Capture = pytest.CaptureFixture[str]
STORES = sorted(FOLDER.glob("*.tar.xz"))


def unpacked(version: Path, to: Path) -> Path:
    """A store of that version, to be used."""
    with tarfile.open(version) as file:
        if hasattr(tarfile, "data_filter"):  # from 3.11.4 on, and from 3.14 on without being asked for
            file.extraction_filter = tarfile.data_filter
        file.extractall(to)
    return to / "store"


@pytest.mark.parametrize("version", STORES, ids=lambda path: path.name)
def test_a_store_of_an_earlier_version_is_read_as_it_was_written(
    version: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    folder = unpacked(version, tmp_path)
    monkeypatch.setenv("WHYHOT_STORE", str(folder))
    rows = stored(folder)
    expected = json.loads(version.with_name(version.name.replace("tar.xz", "json")).read_text(encoding="utf-8"))
    assert said(folder) == expected
    assert main(["verify", "--read", "--since", expected["head"]]) == 0
    capsys.readouterr()
    assert main(["sql", "SELECT count(*) FROM samples", "--csv"]) == 0
    assert int(capsys.readouterr().out.split()[1]) > 1000
    assert main(["upgrade", "--dry-run"]) == 0
    can_bench.write_files(tmp_path)
    can_bench.write_log(tmp_path / "new.blf", seconds=20)
    words = ["--bench", str(tmp_path / "bench.toml"), "--dbc", str(tmp_path / "bench.dbc")]
    assert main(["ingest", str(tmp_path / "new.blf"), *words]) == 0
    assert stored(folder)[: len(rows)] == rows, "written anew"


def test_what_an_earlier_version_decoded_comes_back_by_an_upgrade_and_not_by_a_rebuild(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    folder = unpacked(FOLDER / "whyhot-0.1.0.tar.xz", tmp_path)
    monkeypatch.setenv("WHYHOT_STORE", str(folder))
    shutil.rmtree(folder / "decoded")  # as in a store that was restored from a backup
    assert main(["rebuild"]) == 1
    out, err = capsys.readouterr()
    assert out.startswith("rebuilt 0 decoded files")
    assert "1 log decoded by another version, whose files this one does not make again: 1_s1.blf; next: " in err
    assert main(["upgrade"]) == 0
    assert main(["rebuild", "--verify"]) == 0
    out, err = capsys.readouterr()
    assert "rebuilt 3 decoded files" in out and err == ""
    assert main(["verify", "--read"]) == 0
    assert "is missing" not in capsys.readouterr().err
    assert main(["sql", "SELECT count(*) FROM samples", "--csv"]) == 0
    assert int(capsys.readouterr().out.split()[1]) > 1000


def test_every_kind_of_event_lies_in_a_store_that_is_kept(tmp_path: Path) -> None:
    kept = {row[3] for place, version in enumerate(STORES) for row in stored(unpacked(version, tmp_path / str(place)))}
    assert kept >= set(EVENTS), "pack a store that holds it, as made/every_event.py says"


@pytest.fixture
def store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = unpacked(FOLDER / "whyhot-0.1.0.tar.xz", tmp_path)
    monkeypatch.setenv("WHYHOT_STORE", str(folder))
    return folder


def test_a_store_of_a_newer_version_is_refused_in_one_line(store: Path, capsys: Capture) -> None:
    (store / "store.json").write_text('{"schema": "whyhot.store/4"}\n', encoding="utf-8")
    for words in (["sessions"], ["sql", "FROM sessions"], ["replay"], ["upgrade", "--dry-run"]):
        assert main(words) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert "schema 'whyhot.store/4' is not known here (this is whyhot.store/1): update whyhot" in line


@pytest.mark.parametrize("mark", ["", "[]", "[" * 100_000])
def test_a_mark_that_is_none_is_refused_in_one_line(store: Path, capsys: Capture, mark: str) -> None:
    (store / "store.json").write_text(mark, encoding="utf-8")
    assert main(["sessions"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "store.json: is not readable" in line


def test_an_event_of_a_newer_version_is_refused_in_one_line(store: Path, capsys: Capture) -> None:
    position, stream, version, topic, state = stored(store)[0]
    envelope = resealed(stream, version, topic, json.loads(state) | {"v": 2})
    change(store, "UPDATE stored_events SET state=? WHERE rowid=?", json.dumps(envelope).encode(), position)
    envelope["digest"] = resealed(stream, version, topic, envelope)["digest"]
    assert main(["sessions"]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1


def test_an_event_of_an_earlier_version_is_read_as_it_would_be_written_today(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with Store.open(tmp_path / "store", create=True) as opened:
        opened.ledger.append("file-a", raw("a.blf"))
    before = stored(tmp_path / "store")

    class Newer(Event):
        sha256: str
        called: str
        size: int
        format: str | None
        VERSION: ClassVar[int] = 3
        EARLIER: ClassVar = {
            1: lambda body: {**body, "named": body["name"]},
            2: lambda body: {"called": body["named"]} | {key: body[key] for key in ("sha256", "size", "format")},
        }

    Newer.TOPIC = RawFileSealed.TOPIC
    monkeypatch.setitem(events.EVENTS, RawFileSealed.TOPIC, Newer)
    with Store.open(tmp_path / "store", write=True) as opened:
        (one,) = opened.ledger.events(Newer)
        assert isinstance(one.event, Newer) and one.event.called == "a.blf"
        opened.ledger.append("file-b", Newer(sha256="b", called="b.blf", size=1, format=None))
    assert stored(tmp_path / "store")[: len(before)] == before
    with Store.open(tmp_path / "store") as opened:
        assert [vars(one.event)["called"] for one in opened.ledger.events(Newer)] == ["a.blf", "b.blf"]


def test_an_upgrade_decodes_anew_what_an_earlier_decoder_made_and_leaves_what_a_later_one_did(
    store: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    rows, before = stored(store), said(store)
    monkeypatch.setattr(decode, "DECODER", "whyhot-decoder/999")
    assert main(["upgrade", "--dry-run"]) == 0
    assert "to be decoded again, made by an earlier version: 1_s1.blf" in " ".join(capsys.readouterr().out.split())
    assert stored(store) == rows
    assert main(["upgrade"]) == 0
    after = said(store)
    assert [one[:2] for one in after["sessions"]] == [one[:2] for one in before["sessions"]]
    assert len(after["products"]) == len(before["products"]) + 1
    capsys.readouterr()
    assert main(["upgrade"]) == 0
    assert "all made by this version: nothing to do" in " ".join(capsys.readouterr().out.split())
    monkeypatch.undo()  # the earlier version again, beside the newer one
    monkeypatch.setenv("WHYHOT_STORE", str(store))
    left, kept = "1_s1.blf: was decoded by a newer version (whyhot-decoder/999, this is ", stored(store)
    for words in (["upgrade"], ["upgrade", "--dry-run"]):
        assert main(words) == 1
        out, err = capsys.readouterr()
        assert left in err and "none made by an earlier version: nothing to do" in " ".join(out.split())
    assert main(["rebuild"]) == 0
    assert left in capsys.readouterr().err
    log = tmp_path / "1_s1.blf"
    with Store.open(store) as opened:
        log.write_bytes(opened.archive.read(facts.at(opened.ledger).session("1_s1").files[0]["raw"]))
    assert main(["ingest", str(log)]) == 1
    assert left in capsys.readouterr().err and stored(store) == kept
    with Store.open(store) as opened:
        assert upgrade.needed(opened.ledger.events(), facts.at(opened.ledger)).logs == {}
    assert main(["verify", "--read"]) == 0
