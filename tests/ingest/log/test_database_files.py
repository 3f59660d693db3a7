"""Databases of every kind: told by what they hold, decoded as cantools decodes them, refused in one line."""

from __future__ import annotations

import random
import sys
from collections.abc import Callable
from importlib import import_module

import cantools
import numpy as np
import pytest

from ingest.errors import DatabaseError
from ingest.formats import Frames
from ingest.log.databases import load
from ingest.log.frames import FrameBatch
from made.databases import EXTENDED_MULTIPLEXED_DBC, MULTIPLEXED_DBC, as_arxml, as_kcd, as_sym

COUNT, LENGTH = 200, 8


def frames(can_id: int, payloads: list[bytes]) -> FrameBatch:
    count = len(payloads)
    offsets = np.arange(count + 1) * LENGTH
    data = np.frombuffer(b"".join(payloads), np.uint8)
    bus, ids, flags = np.ones(count, np.uint8), np.full(count, can_id, np.uint32), np.zeros(count, np.uint8)
    return FrameBatch(Frames(np.arange(count), bus, ids, flags, offsets, data, np.arange(count)))


def test_a_database_is_read_without_what_cantools_drives_buses_with(monkeypatch: pytest.MonkeyPatch) -> None:
    """python-can imports asammdf too, where that is installed. The whole of cantools is there afterwards."""
    for name in [one for one in sys.modules if one.partition(".")[0] in ("can", "cantools")]:
        monkeypatch.delitem(sys.modules, name)
    assert load(MULTIPLEXED_DBC.encode(), "renamed.txt").messages
    assert not {"can", "cantools"} & sys.modules.keys()
    assert import_module("cantools").database.load_string(MULTIPLEXED_DBC).messages


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        (lambda: MULTIPLEXED_DBC, "DBC"),
        (lambda: EXTENDED_MULTIPLEXED_DBC, "DBC"),
        (as_kcd, "KCD"),
        (as_sym, "SYM"),
        (as_arxml, "ARXML"),
    ],
    ids=["DBC", "extended multiplexing", "KCD", "SYM", "ARXML"],
)
def test_a_database_decodes_as_cantools_does_whatever_it_is_called(text: Callable[[], str], kind: str) -> None:
    """A value that cantools does not give is missing; frames of a page that no signal is on hold none but the page."""
    database, chance = load(text().encode(), "renamed.txt"), random.Random(1)
    assert (database.kind, database.notes) == (kind, ())
    known = cantools.database.load_string(text(), kind.lower())
    assert isinstance(known, cantools.database.can.Database)
    assert {message.name for message in known.messages} >= {"Motor"}
    for message in known.messages:
        payloads = [chance.randbytes(LENGTH) for _ in range(COUNT)]
        ours = frames(message.frame_id, payloads).signals(database.messages[message.frame_id], np.arange(COUNT))
        seen = 0
        for i, payload in enumerate(payloads):
            try:
                theirs = message.decode(payload, decode_choices=False)
            except cantools.database.errors.DecodeError:
                continue
            assert {name: value[i] for name, value in ours.items() if not np.isnan(value[i])} == theirs
            seen += 1
        assert seen > COUNT // 20


@pytest.mark.parametrize("text", [as_kcd, as_sym, as_arxml])
def test_units_are_those_of_the_file(text: Callable[[], str]) -> None:
    signals = {one.name: one for one in load(text().encode(), "x").messages[0x123].signals}
    assert signals["Speed"].unit == "rpm"
    assert signals["Speed"].layout.scale == 0.5


def test_a_signal_that_lies_elsewhere_on_another_page_has_the_page_in_its_name() -> None:
    first, second = as_sym().rsplit('Sig="Speed" 32', 1)
    database = load(f'{first}Sig="Speed" 40{second}'.encode(), "x.sym")
    found = {one.name: (one.layout.start, one.when) for one in database.messages[0x123].signals}
    assert found["Speed"] == (39, (0,)) and found["Speed_Page1"] == (47, (1,))
    assert database.notes == ("x.sym: Motor.Speed lies elsewhere on another page: Speed_Page1 there",)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_a_database_is_read_in_any_encoding_that_it_says(encoding: str) -> None:
    assert load(as_sym().encode(encoding), "x.sym").messages[0x123].name == "Motor"


BOMB = '<!DOCTYPE x [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;">]>'


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("<?xml version='1.0'?><CANDELA/>", "x: is a CDD: it describes diagnostics, not frames. Name a DBC, KCD, SYM"),
        ("LIN_description_file;", "x: is an LDF: it describes a LIN bus, and LIN is not read. Name a DBC"),
        ("<html></html>", "x: is XML, but neither KCD nor ARXML. Name a DBC"),
        (f"{BOMB}<NetworkDefinition/>", "x: holds XML declarations that no signal database needs. Name a DBC"),
        ("<NetworkDefinition", 'x:1: "<NetworkDefinition" is not KCD at column'),
        ("<AUTOSAR></AUTOSAR>", "x: No XML namespace specified or illegal root tag name 'AUTOSAR'. Correct the ARXML"),
        ('FormatVersion=5.0 // x\nTitle="t"\n', "x: Only SYM version 6.0 is supported. Correct the SYM"),
    ],
)
def test_what_is_not_read_is_refused_in_one_line(text: str, line: str) -> None:
    with pytest.raises(DatabaseError) as refused:
        load(text.encode(), "x")
    assert str(refused.value).startswith(line)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("text", [as_kcd, as_sym, as_arxml])
def test_a_damaged_database_is_read_or_refused_in_one_line(text: Callable[[], str]) -> None:
    whole, chance = text().encode(), random.Random(3)
    for _ in range(60):
        damaged = bytearray(whole[: chance.randrange(20, len(whole))] if chance.random() < 0.5 else whole)
        damaged[chance.randrange(len(damaged))] = chance.randrange(256)
        try:
            load(bytes(damaged), "x")
        except DatabaseError as error:
            assert str(error).startswith("x") and "\n" not in str(error)
