"""A record of a log is found again where it stands in the file's own bytes."""

from __future__ import annotations

import re
import zlib
from pathlib import Path

import pytest

from ingest.errors import DamageError
from ingest.facts import facts
from ingest.facts.sessions import Override
from ingest.facts.store import Store
from ingest.formats import Frames, Log, open_log
from ingest.intake.intake import take_in
from ingest.intake.located import Located, locate
from ingest.intake.setup import MotorFile, prepare
from made.places import LOGS

ALL = range(100)


def read(name: str) -> tuple[Log, dict[int, str]]:
    """A sample read with the places of all records noted, and the payload of each frame in hexadecimal."""
    log = open_log(LOGS / f"sample.{name}")
    log.sought = ALL
    payloads = {}
    for batch in log.batches():
        if isinstance(batch, Frames):
            for i, record in enumerate(batch.record.tolist()):
                payloads[record] = batch.data[batch.offsets[i] : batch.offsets[i + 1]].tobytes().hex()
    return log, payloads


def test_at_the_byte_that_is_told_of_a_packed_log_stands_the_frame() -> None:
    log, payloads = read("blf")
    data, whole = log.path.read_bytes(), 0
    for record, payload in payloads.items():
        place = re.fullmatch(r"byte ([0-9,]+), unpacked \+([0-9,]+)", log.places[record])
        assert place
        at, inside = (int(number.replace(",", "")) for number in place.groups())
        assert data[at : at + 4] == b"LOBJ", "an outer object of the file"
        unpacked = zlib.decompressobj().decompress(data[at + 32 :])
        assert unpacked[inside : inside + 4] == b"LOBJ", "the frame's own object in it"
        size = int.from_bytes(unpacked[inside + 8 : inside + 12], "little")
        if inside + size <= len(unpacked):  # one goes on in the next outer object
            assert bytes.fromhex(payload) in unpacked[inside : inside + size]
            whole += 1
    assert whole > 2


def test_the_line_that_is_told_of_a_text_holds_the_frame() -> None:
    log, payloads = read("candump")
    lines = log.path.read_text().splitlines()
    for record, payload in payloads.items():
        number = int(log.places[record].removeprefix("line "))
        assert payload.upper() in lines[number - 1].upper().replace(" ", "")
    assert len(payloads) > 2


def test_the_line_that_is_told_of_a_table_is_the_row() -> None:
    log, _ = read("csv")
    lines = log.path.read_bytes().decode("cp1252").splitlines()
    rows = [place for place, line in enumerate(lines, 1) if line.strip() and place > 2]
    assert [log.places[record] for record in range(len(rows))] == [f"line {place}" for place in rows]


@pytest.mark.parametrize("path", sorted(LOGS.iterdir()), ids=lambda path: path.suffix[1:])
def test_asking_for_places_changes_nothing_that_is_read(path: Path) -> None:
    plain, asked = open_log(path), open_log(path)
    asked.sought = ALL
    counts = [[len(batch.record) for batch in log.batches()] for log in (plain, asked)]
    assert counts[0] == counts[1]
    assert (plain.found, plain.settings, plain.places) == (asked.found, asked.settings, {})
    assert set(asked.places) <= set(range(plain.found))


def _no_motor(path: Path) -> MotorFile:
    raise AssertionError(f"{path} should not be read")


def test_a_record_is_read_from_sealed_bytes_and_damage_is_told(tmp_path: Path) -> None:
    log = tmp_path / "a.csv"
    log.write_text("time,T\n2026-01-01T08:00:00Z,20.5\n2026-01-01T08:00:10.5Z,bad\n2026-01-01T08:00:20.5Z,21.5\n" * 1)
    with Store.open(tmp_path / "s", create=True) as store:
        take_in(store, [log], prepare([log], None, [], _no_motor), Override())
        known = facts.at(store.ledger)
        (decode,) = known.decodes.values()
        log.unlink()
        first, bad, last = locate(store, known, decode, [2, 0, 1, 9])
        assert (first.where, first.holds, first.stamp(True)) == ("line 2", "T 20.5", "2026-01-01 08:00:00")
        assert (bad.t_ns, bad.where, bad.stamp(True)) == (None, "line 3, column T", "rejected")
        assert bad.holds.startswith('text "bad" where numbers are: 32 30')
        assert (last.where, last.stamp(True)) == ("line 4", "2026-01-01 08:00:20.5")
        sealed = store.archive.path(decode.raw)
        sealed.chmod(0o644)
        sealed.write_bytes(b"other")
        with pytest.raises(DamageError, match=r"a\.csv: .*is damaged"):
            locate(store, known, decode, [0])


def test_a_stamp_without_absolute_time_is_in_seconds() -> None:
    assert Located(0, None, 1_500_000_000, "").stamp(False) == "1.5 s"
