"""Folders, patterns and archives as arguments: which files are logs, and what is said of those that are none."""

from __future__ import annotations

import gzip
import os
import re
import shutil
import zipfile
from pathlib import Path

import pytest

from ingest.errors import IngestError
from ingest.facts import facts
from ingest.facts.sessions import Override
from ingest.facts.store import Store
from ingest.intake.given import databases_given, opened
from ingest.intake.intake import take_in
from ingest.intake.making import redecode
from ingest.intake.setup import MotorFile, prepare
from made.places import LOGS, ROOT

TABLE = "time,T_winding\n0,20.5\n1,20.6\n"


@pytest.fixture
def night(tmp_path: Path) -> Path:
    """A folder with logs, a folder in it, an archive, and things that are no logs."""
    folder = tmp_path / "night"
    (folder / "sub").mkdir(parents=True)
    for name in ("10_s1.csv", "2_s2.csv", ".hidden.csv", "~$2_s2.csv"):
        (folder / name).write_text(TABLE, encoding="utf-8")
    shutil.copy(LOGS / "sample.blf", folder / "sub" / "S3")
    (folder / "notes.csv").write_text("# Night shift\nall well, but cold\n", encoding="utf-8")
    (folder / "moved.csv").symlink_to(folder / "nowhere.csv")
    (folder / "photo.jpg").write_bytes(b"\xff\xd8\xff\xe0" + os.urandom(500))
    with zipfile.ZipFile(folder / "more.zip", "w") as archive:
        archive.writestr("S4.csv", TABLE + "2,20.7\n")
        archive.writestr("README", "what lies here\n")
        archive.writestr("inner.zip", b"PK\x05\x06" + bytes(18))
    return folder


def test_a_text_of_numbers_without_names_is_said_to_be_one(tmp_path: Path) -> None:
    why = "line 1 holds numbers where the names of the columns should be. Put a line of names above them"
    (tmp_path / "raw.txt").write_text("0.0\t20.5\n0.1\t20.6\n", encoding="utf-8")
    (tmp_path / "notes.txt").write_text("Sensor 3 moved.\n", encoding="utf-8")
    (tmp_path / "log.csv").write_text(TABLE, encoding="utf-8")
    with opened([tmp_path]) as given:
        assert given.skipped == [
            "notes.txt: is a text without a table. Skipped.",
            f"raw.txt: is a text without a table: {why}. Skipped.",
        ]


def test_a_folder_is_all_logs_in_it_by_what_they_hold(night: Path) -> None:
    why = (
        "most rows hold 4 fields where line 1 holds 2: it is not their header. Under [time] of the bench file say how "
        "many lines stand above it (skip_rows = 1), or export the table again"
    )
    photo = "photo.jpg: is a picture or a film. Keep it beside the logs with whyhot attach FILE --specimen S"
    with opened([night]) as given:
        assert [path.name for path in given.logs] == ["2_s2.csv", "10_s1.csv", "S4.csv in more.zip", "S3"]
        assert set(given.logs.values()) == {night} and given.refused == []
        assert given.skipped == [
            "README in more.zip: is a text without a table. Skipped.",
            "inner.zip in more.zip: is an archive in an archive. Unpack it first. Skipped.",
            "moved.csv: cannot be opened (No such file or directory). Skipped.",
            f"notes.csv: is a text without a table: {why}. Skipped.",
            f"{photo} --finding TEXT. Skipped.",
        ]
        unpacked = next(path for path in given.logs if "more.zip" in path.name)
        assert unpacked.read_text(encoding="utf-8").startswith(TABLE)
    assert not unpacked.exists()


@pytest.mark.parametrize(
    ("pattern", "names"),
    [
        ("night/*.csv", ["2_s2.csv", "10_s1.csv"]),
        ("night/[0-9]*", ["2_s2.csv", "10_s1.csv"]),
        ("night/**/S?", ["S3"]),
        ("nig*", []),
    ],
)
def test_a_pattern_is_the_logs_that_it_fits(night: Path, pattern: str, names: list[str]) -> None:
    with opened([night.parent / pattern]) as given:
        assert [path.name for path in given.logs] == names
        assert given.refused == (
            [] if names else [f"{night.parent / pattern}: holds no log: correct the path, or name the files."]
        )


def test_a_file_that_is_named_itself_is_left_to_its_reader(night: Path) -> None:
    named = [night / "notes.csv", night / "photo.jpg", night / "2_s2.csv"]
    with opened(named) as given:
        assert (list(given.logs), given.skipped, given.refused) == (named, [], [])


def test_a_name_with_brackets_is_a_file_before_it_is_a_pattern(tmp_path: Path) -> None:
    (tmp_path / "S[1].csv").write_text(TABLE, encoding="utf-8")
    (tmp_path / "[a]").mkdir()
    (tmp_path / "[a]" / "S2.csv").write_text(TABLE, encoding="utf-8")
    with opened([tmp_path / "S[1].csv", tmp_path / "[a]"]) as given:
        assert [path.name for path in given.logs] == ["S[1].csv", "S2.csv"]


def test_what_is_not_there_or_cannot_be_unpacked_is_said(night: Path) -> None:
    gone = r"gone\.csv: there is no such file: correct the path\."
    with pytest.raises(IngestError, match=gone), opened([Path("gone.csv")]):
        pass
    packed = gzip.compress((LOGS / "sample.blf").read_bytes())
    (night / "broken.blf.gz").write_bytes(packed[:-8] + b"\0" * 8)
    with opened([night / "broken.blf.gz"]) as given:
        assert not given.logs
        assert given.refused[0].startswith("broken.blf in broken.blf.gz: is damaged (CRC check failed")


def test_the_folder_that_one_is_in_is_no_pattern(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with opened([Path()]) as given:
        assert given.refused == [".: holds no log: correct the path, or name the files."]


def test_no_file_of_this_project_but_its_recordings_is_taken_for_a_log() -> None:
    folders = [ROOT / "docs", ROOT / "ingest", ROOT / "tests" / "made"]
    with opened([*folders, ROOT / "examples"]) as given:
        assert {path.suffix for path in given.logs} <= {".gz", ".csv", ".asc", ".blf"}
        assert set(given.logs.values()) == {ROOT / "examples"}
    assert given.refused == [f"{one}: holds no log: correct the path, or name the files." for one in folders]


def test_a_file_that_cannot_be_opened_is_named(night: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def shut(path: Path) -> bool:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("ingest.intake.given.is_archive", shut)
    with opened([night / "sub"]) as given:
        assert (given.logs, given.skipped) == ({}, ["S3: cannot be opened (Permission denied). Skipped."])


def _no_motor(path: Path) -> MotorFile:
    raise AssertionError(path)


def test_logs_of_an_archive_are_facts_of_their_own_and_are_made_again_from_them(night: Path, tmp_path: Path) -> None:
    with opened([night / "more.zip"]) as given, Store.open(tmp_path / "store", create=True, write=True) as store:
        paths = list(given.logs)
        taken = take_in(store, paths, prepare(paths, None, [], _no_motor), Override())
    ((name, decode),) = ((one.name, one.decode) for one in taken.files)
    assert name == "S4.csv in more.zip" and decode and decode.balance["found"] == 3
    assert [session.name for session in taken.sessions] == ["S4"]
    with opened([tmp_path]) as given:
        assert not any("store" in path.parts for path in given.logs)
    shutil.rmtree(night)
    shutil.rmtree(tmp_path / "store" / "decoded")
    with Store.open(tmp_path / "store", write=True) as store:
        redecode(store, facts.at(store.ledger))
    assert list((tmp_path / "store" / "decoded").glob("*/recording.mcap"))


DATABASES = [
    ("bus.dbc", 'VERSION ""\nNS_ :\nBU_: ECU\n'),
    ("bare.dbc", "BO_ 256 Drive: 8 ECU\n"),
    ("bus.kcd", '<?xml version="1.0"?>\n<NetworkDefinition xmlns="http://kayak.2codeornot2code.org/1.0">\n'),
    ("bus.sym", 'FormatVersion=6.0 // Do not edit this line!\nTitle="bus"\n'),
]


@pytest.mark.parametrize(("name", "text"), DATABASES)
def test_a_database_in_a_folder_is_named_as_one(tmp_path: Path, name: str, text: str) -> None:
    (tmp_path / name).write_text(text, encoding="utf-8")
    (tmp_path / "1.csv").write_text(TABLE, encoding="utf-8")
    with opened([tmp_path]) as given:
        assert given.skipped == [f"{name}: describes signals of a bus: give it with --dbc. Skipped."]


def test_databases_are_given_as_files_folders_and_patterns_and_named_no_more(night: Path) -> None:
    for name, text in DATABASES:
        (night / "sub" / name).write_text(text, encoding="utf-8")
    (night / "sub" / "bus.txt").write_text(DATABASES[0][1], encoding="utf-8")
    names = {name: night / "sub" / name for name in ("bare.dbc", "bus.dbc", "bus.kcd", "bus.sym", "bus.txt")}
    assert databases_given([night]) == list(names.values())
    assert databases_given([night / "*" / "*.dbc", names["bus.dbc"]]) == [names["bare.dbc"], names["bus.dbc"]]
    with opened([night / "sub"], databases_given([night / "sub"])) as given:
        assert [path.name for path in given.logs] == ["S3"] and given.skipped == []
    for argument, why in (("2*", "holds no signal database"), ("a*", "nothing fits"), ("gone.dbc", "there is no such")):
        with pytest.raises(IngestError, match=rf"^--dbc .*{re.escape(argument)}: {why}"):
            databases_given([night / argument])
