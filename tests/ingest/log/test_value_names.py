"""Names of a database that say that there is no number, against what was sent."""

from __future__ import annotations

import numpy as np
import pytest

from ingest.formats import Frames
from ingest.log.bits import Layout
from ingest.log.databases import load
from ingest.log.frames import FrameBatch
from ingest.log.value_names import no_numbers_named

DBC = """VERSION ""
NS_ :
BS_:
BU_: ECU
BO_ 256 Inverter: 3 ECU
 SG_ T_igbt : 0|8@1+ (1,-40) [-40|213] "degC" ECU
 SG_ Torque : 8|8@1- (1,0) [-126|127] "Nm" ECU
 SG_ State : 16|2@1+ (1,0) [0|3] "" ECU
 SG_ Gear : 18|3@1+ (1,0) [0|7] "" ECU
VAL_ 256 T_igbt 255 "SNA" 254 "Error" 0 "cold" ;
VAL_ 256 Torque -128 "Signal_not_available" 0 "No error" ;
VAL_ 256 State 0 "Off" 1 "On" 2 "Error" 3 "SNA" ;
VAL_ 256 Gear 7 "SNA" ;
"""
WORDS = Layout(0, 16, scale=0.1)


def test_numbers_that_are_named_as_none_are_missing_and_counted() -> None:
    sent = [bytes([0, 0, 0]), bytes([255, 128, 0b11111]), bytes([254, 127, 0b10]), bytes([253, 129, 1])]
    count = len(sent)
    frames = Frames(
        t_ns=np.arange(count),
        bus=np.ones(count, np.uint8),
        can_id=np.full(count, 256, np.uint32),
        flags=np.zeros(count, np.uint8),
        offsets=np.arange(count + 1) * 3,
        data=np.frombuffer(b"".join(sent), np.uint8),
        record=np.arange(count),
    )
    batch = FrameBatch(frames)
    found = batch.signals(load(DBC.encode(), "inverter.dbc").messages[256], np.arange(count))
    nan = float("nan")
    assert np.array_equal(found["T_igbt"], [-40, nan, nan, 213], equal_nan=True)
    assert np.array_equal(found["Torque"], [0, nan, 127, -127], equal_nan=True)
    assert found["State"].tolist() == [0, 3, 2, 1] and found["Gear"].tolist() == [0, 7, 0, 0]  # names of states
    assert batch.not_available == {"Inverter.T_igbt": 1, "Inverter.Torque": 1}
    assert batch.errors == {"Inverter.T_igbt": 1}


@pytest.mark.parametrize(
    "name",
    [
        *("SNA", "sna", "SNA (Signal not available)", "UNKNOWN_SNA", "Signal not available", "SignalNotAvailable"),
        *("N/A", "invalid", "Invalid_Value", "Signal_ungueltig", "ungültig", "Wert nicht verfügbar", "undefined"),
        *("Reserved", "not_used", "No Signal", "Init", "Initialization", "Initial value"),
    ],
)
def test_a_name_says_that_there_is_no_number(name: str) -> None:
    assert no_numbers_named({65535: name}, WORDS, None) == ((), (65535,))


@pytest.mark.parametrize(
    "name", ["Error", "Fehler", "Signal_Error", "SensorFault", "Sensor defekt", "Drahtbruch", "OutOfRange"]
)
def test_a_name_says_that_there_is_an_error(name: str) -> None:
    assert no_numbers_named({65534: name}, WORDS, None) == ((65534,), ())


@pytest.mark.parametrize(
    "name", ["No error", "kein Fehler", "Max", "no limit", "Off", "Idle", "open", "HI", "straight", "3rd"]
)
def test_other_names_are_those_of_numbers(name: str) -> None:
    assert no_numbers_named({0: name, 65535: name}, WORDS, "A") == ((), ())


def test_what_is_sent_before_there_is_a_value_is_one_where_it_is_zero() -> None:
    assert no_numbers_named({0: "Init"}, WORDS, "rpm") == ((), ())


@pytest.mark.parametrize(
    ("layout", "unit"),
    [(Layout(0, 8), None), (Layout(0, 8), "status"), (Layout(0, 2), "A"), (Layout(0, 32, is_float=True), "A")],
)
def test_names_of_states_and_of_floats_say_nothing(layout: Layout, unit: str | None) -> None:
    assert no_numbers_named({2: "Error", 3: "SNA"}, layout, unit) == ((), ())
