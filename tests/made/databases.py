"""One message, `Motor`, in every kind of database that is read: written by cantools, and by hand as ARXML."""

from __future__ import annotations

import cantools
from cantools.database.can.database import Database

MULTIPLEXED_DBC = """VERSION ""

NS_ :

BS_:

BU_: BENCH

BO_ 291 Motor: 8 BENCH
 SG_ Page M : 0|4@1+ (1,0) [0|15] "" BENCH
 SG_ T_0 m0 : 8|16@1- (0.01,0) [-300|300] "degC" BENCH
 SG_ T_1 m1 : 8|12@1+ (0.1,-40) [-40|300] "degC" BENCH
 SG_ Speed : 39|16@0- (0.5,0) [-16000|16000] "rpm" BENCH
"""
EXTENDED_MULTIPLEXED_DBC = (
    MULTIPLEXED_DBC
    + """
BO_ 292 Pages: 8 BENCH
 SG_ One M : 0|4@1+ (1,0) [0|15] "" BENCH
 SG_ Two m1M : 4|4@1+ (1,0) [0|15] "" BENCH
 SG_ Deep m2 : 8|8@1+ (2,0) [0|510] "" BENCH
 SG_ Shallow m0 : 8|8@1+ (1,0) [0|255] "" BENCH

SG_MUL_VAL_ 292 Two One 1-2;
SG_MUL_VAL_ 292 Deep Two 2-3,7-7;
SG_MUL_VAL_ 292 Shallow One 0-0,5-9;
"""
)


def _database() -> Database:
    found = cantools.database.load_string(MULTIPLEXED_DBC, "dbc")
    assert isinstance(found, Database)
    return found


def as_kcd() -> str:
    return _database().as_kcd_string()


def as_sym() -> str:
    return _database().as_sym_string()


def _element(tag: str, name: str, inner: str) -> str:
    return f"<{tag}><SHORT-NAME>{name}</SHORT-NAME>{inner}</{tag}>"


def _ref(tag: str, kind: str, name: str) -> str:
    return f'<{tag} DEST="{kind}">/P/{name}</{tag}>'


def as_arxml() -> str:
    """`Speed` of `Motor` alone."""
    law = (
        "<CATEGORY>LINEAR</CATEGORY><COMPU-INTERNAL-TO-PHYS><COMPU-SCALES><COMPU-SCALE><COMPU-RATIONAL-COEFFS>"
        "<COMPU-NUMERATOR><V>0</V><V>0.5</V></COMPU-NUMERATOR><COMPU-DENOMINATOR><V>1</V></COMPU-DENOMINATOR>"
        "</COMPU-RATIONAL-COEFFS></COMPU-SCALE></COMPU-SCALES></COMPU-INTERNAL-TO-PHYS>"
    )
    place = "<PACKING-BYTE-ORDER>MOST-SIGNIFICANT-BYTE-FIRST</PACKING-BYTE-ORDER><START-POSITION>39</START-POSITION>"
    mapping = _element("I-SIGNAL-TO-I-PDU-MAPPING", "M", _ref("I-SIGNAL-REF", "I-SIGNAL", "Speed") + place)
    pdu = f"<LENGTH>8</LENGTH><I-SIGNAL-TO-PDU-MAPPINGS>{mapping}</I-SIGNAL-TO-PDU-MAPPINGS>"
    in_frame = _element(
        "PDU-TO-FRAME-MAPPING", "F", _ref("PDU-REF", "I-SIGNAL-I-PDU", "Pdu") + "<START-POSITION>0</START-POSITION>"
    )
    frame = f"<FRAME-LENGTH>8</FRAME-LENGTH><PDU-TO-FRAME-MAPPINGS>{in_frame}</PDU-TO-FRAME-MAPPINGS>"
    addressing = "<CAN-ADDRESSING-MODE>STANDARD</CAN-ADDRESSING-MODE><IDENTIFIER>291</IDENTIFIER>"
    trigger = _element("CAN-FRAME-TRIGGERING", "T", _ref("FRAME-REF", "CAN-FRAME", "Motor") + addressing)
    channel = _element("CAN-PHYSICAL-CHANNEL", "C", f"<FRAME-TRIGGERINGS>{trigger}</FRAME-TRIGGERINGS>")
    cluster = (
        "<CAN-CLUSTER-VARIANTS><CAN-CLUSTER-CONDITIONAL><BAUDRATE>500000</BAUDRATE>"
        f"<PHYSICAL-CHANNELS>{channel}</PHYSICAL-CHANNELS></CAN-CLUSTER-CONDITIONAL></CAN-CLUSTER-VARIANTS>"
    )
    kind = "<BASE-TYPE-SIZE>16</BASE-TYPE-SIZE><BASE-TYPE-ENCODING>2C</BASE-TYPE-ENCODING>"
    network = (
        "<NETWORK-REPRESENTATION-PROPS><SW-DATA-DEF-PROPS-VARIANTS><SW-DATA-DEF-PROPS-CONDITIONAL>"
        f"{_ref('BASE-TYPE-REF', 'SW-BASE-TYPE', 'Int16')}</SW-DATA-DEF-PROPS-CONDITIONAL>"
        "</SW-DATA-DEF-PROPS-VARIANTS></NETWORK-REPRESENTATION-PROPS>"
    )
    physical = (
        "<PHYSICAL-PROPS><SW-DATA-DEF-PROPS-VARIANTS><SW-DATA-DEF-PROPS-CONDITIONAL>"
        f"{_ref('COMPU-METHOD-REF', 'COMPU-METHOD', 'Law')}{_ref('UNIT-REF', 'UNIT', 'Rpm')}"
        "</SW-DATA-DEF-PROPS-CONDITIONAL></SW-DATA-DEF-PROPS-VARIANTS></PHYSICAL-PROPS>"
    )
    elements = (
        _element("CAN-CLUSTER", "Bus", cluster)
        + _element("CAN-FRAME", "Motor", frame)
        + _element("I-SIGNAL-I-PDU", "Pdu", pdu)
        + _element(
            "I-SIGNAL",
            "Speed",
            f"<LENGTH>16</LENGTH>{network}{_ref('SYSTEM-SIGNAL-REF', 'SYSTEM-SIGNAL', 'SpeedSignal')}",
        )
        + _element("SYSTEM-SIGNAL", "SpeedSignal", physical)
        + _element("SW-BASE-TYPE", "Int16", kind)
        + _element("COMPU-METHOD", "Law", law)
        + _element("UNIT", "Rpm", "<DISPLAY-NAME>rpm</DISPLAY-NAME>")
    )
    package = _element("AR-PACKAGE", "P", f"<ELEMENTS>{elements}</ELEMENTS>")
    schema = (
        'xmlns="http://autosar.org/schema/r4.0" xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" '
        'xsi:schemaLocation="http://autosar.org/schema/r4.0 AUTOSAR_4-2-2.xsd"'
    )
    return f'<?xml version="1.0" encoding="UTF-8"?>\n<AUTOSAR {schema}><AR-PACKAGES>{package}</AR-PACKAGES></AUTOSAR>\n'
