"""Signal databases: what is read, what is noted, and how a refusal reads."""

from __future__ import annotations

import hashlib

import pytest

from ingest.bench.signals import Signal
from ingest.errors import DatabaseError
from ingest.formats import EXTENDED
from ingest.log.bits import Layout
from ingest.log.databases import Database, MessageSignal, load, merged, signals_of

HEAD = 'VERSION ""\n\nNS_ :\n\nBS_:\n\nBU_: BENCH\n\n'
MOTOR = (
    HEAD
    + """BO_ 291 Motor: 8 BENCH
 SG_ Speed : 7|16@0- (0.5,0) [-20000|20000] "rpm" BENCH
 SG_ T_wdg : 16|12@1+ (0.1,-40) [-40|369.5] "°C" BENCH
 SG_ Count : 28|4@1+ (1,0) [0|15] "" BENCH

BO_ 2566844672 Logger: 8 BENCH
 SG_ Torque : 0|32@1- (1,0) [0|0] "Nm" BENCH

SIG_VALTYPE_ 2566844672 Torque : 1;
"""
)
MULTIPLEXED = (
    HEAD
    + """BO_ 5 Temperatures: 8 BENCH
 SG_ Page M : 0|4@1+ (1,0) [0|0] "" BENCH
 SG_ T_0 m0 : 8|16@1- (0.01,0) [0|0] "degC" BENCH
 SG_ T_1 m1 : 8|16@1- (0.01,0) [0|0] "degC" BENCH
"""
)


def dbc(text: str, name: str = "motor.dbc", encoding: str = "utf-8") -> Database:
    return load(text.encode(encoding), name)


def test_a_message_keeps_identifier_length_and_layouts() -> None:
    database = dbc(MOTOR)
    motor, logger = database.messages[0x123], database.messages[0x18FEF100 | 1 << 31]
    assert (motor.name, motor.can_id, motor.length) == ("Motor", 0x123, 8)
    assert motor.signals[0] == MessageSignal("Speed", Layout(7, 16, big_endian=True, signed=True, scale=0.5), "rpm")
    assert motor.signals[1] == MessageSignal("T_wdg", Layout(16, 12, scale=0.1, offset=-40), "°C")
    assert logger.can_id & int(EXTENDED)
    assert logger.signals[0].layout == Layout(0, 32, is_float=True)
    assert database.sha256 == hashlib.sha256(MOTOR.encode()).hexdigest()
    assert database.notes == ()


def test_signals_carry_unit_and_resolution_of_the_file() -> None:
    assert [signal for message in dbc(MOTOR).messages.values() for signal in signals_of(message)] == [
        Signal("Speed", "Motor", None, "rpm", 0.5, "motor.dbc"),
        Signal("T_wdg", "Motor", None, "°C", 0.1, "motor.dbc"),
        Signal("Count", "Motor", None, None, 1.0, "motor.dbc"),
        Signal("Torque", "Logger", None, "Nm", None, "motor.dbc"),
    ]


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "cp1252"])
def test_a_degree_sign_is_read_in_either_encoding(encoding: str) -> None:
    assert dbc(MOTOR, encoding=encoding).messages[0x123].signals[1].unit == "°C"


def test_multiplexed_signals_say_when_they_are_there() -> None:
    page, first, second = dbc(MULTIPLEXED).messages[5].signals
    assert (page.multiplexer, page.when) == (None, ())
    assert (first.multiplexer, first.when) == ("Page", (0,))
    assert (second.multiplexer, second.when) == ("Page", (1,))


def test_overlapping_signals_are_read_and_noted_with_their_line() -> None:
    database = dbc(MOTOR.replace("28|4@1+", "20|4@1+"))
    assert len(database.messages[0x123].signals) == 3
    assert database.notes == (
        "motor.dbc:9: The signals Count and T_wdg are overlapping in message Motor: read all the same",
    )


def test_the_first_of_two_messages_with_one_identifier_is_used() -> None:
    database = dbc(MOTOR + '\nBO_ 291 Other: 8 BENCH\n SG_ x : 0|8@1+ (1,0) [0|0] "" BENCH\n')
    assert database.messages[0x123].name == "Motor"
    assert database.notes == ("motor.dbc: Other has the identifier of Motor: Motor, the first, is used",)


def test_a_signal_wider_than_a_word_is_left_out_and_noted() -> None:
    database = dbc(HEAD + 'BO_ 7 Vin: 16 BENCH\n SG_ Text : 0|128@1+ (1,0) [0|0] "" BENCH\n')
    assert database.messages[7].signals == ()
    assert database.notes == ("motor.dbc: Vin.Text has 128 bits: left out",)


def test_where_two_databases_differ_the_first_given_is_used_and_said() -> None:
    old, new = dbc(MOTOR, "old.dbc"), dbc(MOTOR.replace("(0.5,0)", "(0.25,0)"), "new.dbc")
    messages, notes = merged([new, old])
    assert messages[0x123].signals[0].layout.scale == 0.25
    assert notes == ["old.dbc: Motor (0x123) differs from Motor in new.dbc: new.dbc, given first, is used"]


def test_the_same_message_in_two_databases_is_no_conflict() -> None:
    messages, notes = merged([dbc(MOTOR, "a.dbc"), dbc(MOTOR + "\n", "b.dbc")])
    assert len(messages) == 2
    assert notes == []


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("", "motor.dbc:1: the DBC ends before its end. Export the database again, or correct the line."),
        (
            MOTOR.replace("7|16@0-", "7|16@0"),
            (
                'motor.dbc:10: "SG_ Speed : 7|16@0 (0.5,0) [-20000|20000] "rpm" BENCH" is not DBC at column 21. '
                "Export the database again, or correct the line."
            ),
        ),
        (
            MOTOR.replace("BO_ 291 ", "BO_ 5291 "),
            (
                "motor.dbc:9: Standard frame id 0x14ab is more than 11 bits in message Motor. "
                "Correct the DBC, then give it again."
            ),
        ),
    ],
)
def test_a_refusal_is_one_line_with_file_and_line(text: str, line: str) -> None:
    with pytest.raises(DatabaseError) as refused:
        dbc(text)
    assert str(refused.value) == line


def test_bytes_that_are_no_text_are_refused_in_one_line() -> None:
    with pytest.raises(DatabaseError) as refused:
        load(bytes(range(256)) * 4, "x.dbc")
    assert str(refused.value).startswith("x.dbc:1: ")
    assert "\n" not in str(refused.value)
