"""TRC: every version read alike, equal to python-can where that reads it, and all else accounted for."""

from pathlib import Path

import can
import pytest

from ingest.errors import UnreadableLogError
from ingest.formats import EXTENDED, FD, REMOTE, TRANSMIT, TimeSpec, recognise
from made.frames import Frame, as_frames, messages, read, write
from made.places import LOGS

MS_NS = 1_000_000
HEAD = ";$FILEVERSION=2.1\n;$STARTTIME=43008.629319328700\n;$COLUMNS=N,O,T,B,I,d,R,L,D\n"
START_NS = 1_506_783_973_190_000_000  # 30 September 2017, 15:06:13.190 UTC
LONG = 0x18EBFF00 | int(EXTENDED)

# The same frames in each version, as the description of the format writes them: data, sent, extended, remote; an error
# frame; and the state of the bus, which is no frame.
VERSIONS = {
    "1.0": (
        ";   C:\\TraceFile.trc\n;   Start time: 30.09.2017 15:06:13.190\n;---+--   ----+---  --+-- + -+ -- -- ...\n"
        "     1)      1841  0001  8  00 01 02 03 04 05 06 07\n"
        "     2)      1842  0008  4  ERROR 00 19 08 08\n"
        "     3)      1843  FFFFFFFF  4  00 00 00 04 -- -- -- -- BUSLIGHT\n"
        "     4)      1844  18EBFF00  2  0A FF\n"
        "     5)      1845  0100  3  RTR\n"
    ),
    "1.1": (
        ";$FILEVERSION=1.1\n;$STARTTIME=43008.629319328700\n"
        "     1)      1841.0  Rx         0001  8  00 01 02 03 04 05 06 07\n"
        "     2)      1842.0  Error      0008  4  00 19 08 08\n"
        "     3)      1843.0  Warng  FFFFFFFF  4  00 00 00 04  BUSLIGHT\n"
        "     4)      1844.0  Tx     18EBFF00  2  0A FF\n"
        "     5)      1845.0  Rx         0100  3  RTR\n"
    ),
    "1.2": (
        ";$FILEVERSION=1.2\n;$STARTTIME=43008.629319328700\n"
        "     1)      1841.000 1  Rx         0001  8  00 01 02 03 04 05 06 07\n"
        "     2)      1842.000 1  Error      0008  4  00 19 08 08\n"
        "     3)      1843.000 1  Warng  FFFFFFFF  4  00 00 00 04  BUSLIGHT\n"
        "     4)      1844.000 1  Tx     18EBFF00  2  0A FF\n"
        "     5)      1845.000 1  Rx         0100  3  RTR\n"
    ),
    "1.3": (
        ";$FILEVERSION=1.3\n;$STARTTIME=43008.629319328700\n"
        "     1)      1841.000 1  Rx        0001 -  8    00 01 02 03 04 05 06 07\n"
        "     2)      1842.000 1  Error     0008 -  4    00 19 08 08\n"
        "     3)      1843.000 1  Warng FFFFFFFF -  4    00 00 00 04 BUSLIGHT\n"
        "     4)      1844.000 1  Tx    18EBFF00 -  2    0A FF\n"
        "     5)      1845.000 1  Rx        0100 -  3    RTR\n"
    ),
    "2.0": (
        ";$FILEVERSION=2.0\n;$STARTTIME=43008.629319328700\n;$COLUMNS=N,O,T,I,d,l,D\n"
        "      1      1841.000 DT     0001 Rx 8  00 01 02 03 04 05 06 07\n"
        "      2      1842.000 ER          Rx    04 00 02 00 00\n"
        "      3      1843.000 ST          Rx    00 00 00 08\n"
        "      4      1844.000 DT 18EBFF00 Tx 2  0A FF\n"
        "      5      1845.000 RR     0100 Rx 3\n"
    ),
    "2.1": (
        f"{HEAD}"
        "      1      1841.000 DT 1      0001 Rx -  8    00 01 02 03 04 05 06 07\n"
        "      2      1842.000 ER 1         - Rx -  5    04 00 02 00 00\n"
        "      3      1843.000 ST 1         - Rx -  4    00 00 00 08\n"
        "      4      1844.000 DT 1  18EBFF00 Tx -  2    0A FF\n"
        "      5      1845.000 RR 1      0100 Rx -  3\n"
    ),
}


def trc(folder: Path, text: str) -> Path:
    path = folder / "trace"
    path.write_bytes(text.replace("\n", "\r\n").encode())
    return path


def test_the_sample_gives_every_kind_of_frame() -> None:
    log, frames = read(LOGS / "sample.trc")
    assert [(frame[0] - START_NS, *frame[1:]) for frame in frames] == [
        (2_501_000_000, 2, 0x100, TRANSMIT, "0908070605040302"),
        (2_502_000_000, 1, 0x704, REMOTE, ""),
        (2_503_123_000, 1, LONG, 0, "050c00"),
        (2_504_000_000, 1, 0x300, FD, "0102030405060708090a0b0c"),
        (2_506_000_000, 1, 0x124, 0, ""),
    ]
    assert [(one.where, one.why) for one in log.rejected] == [
        ("line 13", "error frame"),
        ("line 15", "holds 3 of its 8 bytes"),
    ]
    assert log.settings == {"version": "2.1", "other_lines": 9, "gz": False}


@pytest.mark.parametrize("version", VERSIONS)
def test_every_version_gives_the_same_frames(tmp_path: Path, version: str) -> None:
    path = trc(tmp_path, VERSIONS[version])
    assert recognise(path).name == "trc"
    log, frames = read(path)
    sent = 0 if version == "1.0" else TRANSMIT  # 1.0 does not tell
    assert frames == [
        (START_NS + 1841 * MS_NS, 1, 1, 0, "0001020304050607"),
        (START_NS + 1844 * MS_NS, 1, LONG, sent, "0aff"),
        (START_NS + 1845 * MS_NS, 1, 0x100, REMOTE, ""),
    ]
    assert [(one.record, one.why) for one in log.rejected] == [(1, "error frame")]
    assert log.absolute and log.cut is None


def test_frames_equal_those_that_python_can_wrote(tmp_path: Path) -> None:
    """Its writer knows no error, remote or FD frames, and counts buses from 1."""
    path, some = tmp_path / "log.trc", [one for one in messages(300, fd=False) if not one.is_remote_frame]
    some = [one for one in some if not one.is_error_frame]
    write(can.TRCWriter(path), some)
    log, frames = read(path)
    assert [(t_ns, bus - 1, *rest) for t_ns, bus, *rest in frames] == as_frames(some)
    assert not log.rejected


@pytest.mark.parametrize(
    ("kind", "code", "length"), [("FD", "09", 12), ("FB", "15", 64), ("FE", "8", 8), ("BI", "0", 0)]
)
def test_frames_of_can_fd_have_the_length_of_their_code(tmp_path: Path, kind: str, code: str, length: int) -> None:
    data = bytes(range(length)).hex(" ")
    _, frames = read(trc(tmp_path, f"{HEAD}  1  0.500 {kind} 1 0123 Tx - {code} {data}\n"))
    assert frames == [(START_NS + 500_000, 1, 0x123, FD | TRANSMIT, bytes(range(length)).hex())]


@pytest.mark.parametrize(
    ("line", "why"),
    [
        ("2 1.0 DT 1 0123 Rx - 8 00 01", "holds 2 of its 8 bytes"),
        ("2 1.0 DT 1 0123 Rx - 2 00 0", "holds 1 of its 2 bytes"),
        ("2 1.0 FD 1 0123 Rx - 16 00", "says it holds more than the 64 bytes of a frame"),
        ("2 1.0 DT 1 0823 Rx - 0", 'has the identifier "823", which is no number of 11 bits'),
        ("2 1.0 DT 1 2FFFFFFF Rx - 0", 'has the identifier "2FFFFFFF", which is no number of 29 bits'),
        ("2 1.0 DT 300 0123 Rx - 0", "its channel is above 255"),
        ("2 1.0 XX 1 0123 Rx - 0", 'has the type "XX", which is none of a frame'),
        ("2 1.0 DT 1 0123", "is a frame that is not complete"),
        ("2 1.0 ER 1 - Rx - 5 04 00 02 00 00", "error frame"),
        ("2 999999999999.0 DT 1 0123 Rx - 0", None),
        ("2 soon DT 1 0123 Rx - 0", "is no line of a TRC file"),
        ("¤%&/ 12", "is no line of a TRC file"),
    ],
)
def test_a_line_that_cannot_be_read_is_rejected_with_its_number(tmp_path: Path, line: str, why: str | None) -> None:
    log, frames = read(trc(tmp_path, f"{HEAD}1 0.0 DT 1 0123 Rx - 0\n{line}\n3 2.0 DT 1 0123 Rx - 0\n"))
    assert len(frames) == (2 if why else 3)
    assert [(one.record, one.where, one.why) for one in log.rejected] == ([(1, "line 5", why)] if why else [])


def test_the_start_is_local_to_the_stated_zone_or_replaced(tmp_path: Path) -> None:
    def first(spec: TimeSpec | None = None, text: str = VERSIONS["1.1"]) -> Frame:
        return read(trc(tmp_path, text), spec)[1][0]

    assert first(TimeSpec(zone="Europe/Berlin"))[0] == START_NS + 1841 * MS_NS - 7200 * 1000 * MS_NS
    assert first(TimeSpec(start_ns=0))[0] == 1841 * MS_NS


@pytest.mark.parametrize("said", ["soon", "-5", "1e999", "0", "NaN"])
def test_a_start_that_is_not_understood_is_said_and_time_counts_from_zero(tmp_path: Path, said: str) -> None:
    log, frames = read(trc(tmp_path, VERSIONS["1.1"].replace("43008.629319328700", said)))
    assert (log.absolute, frames[0][0]) == (False, 1841 * MS_NS)
    assert log.settings["date_not_understood"] == said


@pytest.mark.parametrize(
    ("header", "says"),
    [
        (";$FILEVERSION=3.0\n", 'is a TRC file of version "3.0"; versions 1.0, 1.1, 1.2, 1.3, 2.0, 2.1 are read'),
        (HEAD.replace("I,", ""), "names no column I: its frames cannot be read. Save it with all columns."),
        (";$FILEVERSION=2.1\n;$COLUMNS=N,O,T,B,T,I,d,R,L,D\n", "names column T twice"),
    ],
)
def test_a_version_or_columns_that_cannot_be_read_are_refused(tmp_path: Path, header: str, says: str) -> None:
    with pytest.raises(UnreadableLogError) as refused:
        read(trc(tmp_path, f"{header}1 0.0 DT 1 0123 Rx - 0\n"))
    assert says in str(refused.value)


def test_a_trace_that_ends_inside_a_line_is_cut(tmp_path: Path) -> None:
    log, frames = read(trc(tmp_path, VERSIONS["1.3"] + "  6) 1846.000 1 Rx 0001 - 8 00 01"))
    assert len(frames) == 3
    assert log.cut == "ends inside line 8: 3 frames were read and kept; copy the file again if the original is whole."
