"""The bench file: read strictly, then met with the signals of a log."""

from __future__ import annotations

import csv
import gzip
import json
import math
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import ingest
from ingest.bench import bench_file as bench_module
from ingest.bench import channel_tables
from ingest.bench.bench_file import Bench, read_bench
from ingest.bench.changes import CHANGE_KEYS
from ingest.bench.channel import Channel
from ingest.bench.derating import DERATING_KEYS, DeratingRule
from ingest.bench.resolving import ResolvedChannel, check_nodes, refuse_unit_row, resolve
from ingest.bench.signals import Signal
from ingest.bench.time_tables import LOGGER_KEYS, OF_FORMAT, TIME_KEYS, TIME_UNITS
from ingest.errors import BenchFileError, ExpressionError, IngestError, TomlError, UnitError
from ingest.formats import TimeSpec, utc_ns
from ingest.texts.quantities import CONVENTIONS, STORED_UNIT, Conversion

PACKAGE = Path(ingest.__file__).parent
EXAMPLE = PACKAGE.parent / "examples" / "hust_motor"
SCHEMA = json.loads((PACKAGE / "schema" / "bench.schema.json").read_text(encoding="utf-8"))

TEMPERATURE = 'quantity = "temperature"\nunit = "degC"\n'
LOG = [
    Signal("EW_A_3v", "TempA", None, "°C", 0.5, "bench.dbc"),
    Signal("MAG_1", "TempB", None, "degC", 0.01, "bench.dbc"),
    Signal("Speed", "Motor", None, "rpm", 1.0, "bench.dbc"),
    Signal("IdFbk", "Motor", None, "A", None, "bench.dbc"),
    Signal("IqFbk", "Motor", None, "A", None, "bench.dbc"),
]


def read(text: str) -> Bench:
    return read_bench(text.encode(), "bench.toml")


def one(text: str) -> Channel:
    (channel,) = read(text).channels
    return channel


def resolved(text: str, signals: list[Signal] | None = None, **known: Any) -> ResolvedChannel:
    (channel,) = resolve(read(text), LOG if signals is None else signals, **known)
    return channel


def refusal(kind: type[IngestError], text: str, signals: list[Signal] | None = None) -> str:
    with pytest.raises(kind) as caught:
        resolve(read(text), LOG if signals is None else signals)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_everything_that_a_bench_file_can_say_is_read() -> None:
    bench = read(
        """schema = "whyhot.bench/1"
motor = "../motor.toml"
specimen = "stator-07"
batch_column = "lot"
kind = "wltp"
configuration = "stator_in_air"
attributes = {inverter = "sw 4.2"}
[time]
column = "Time"
format = "%d.%m.%Y %H:%M:%S"
zone = "Europe/Rome"
start = 2024-07-01T10:00:00
join_gap_s = 5
[[channel]]
signal = "can2:TempA.EW_A_3v"
quantity = "temperature"
unit = "degF"
weights = {endwinding_a_outer = 0.7, air_a = 0.3}
region = "copper"
level = "production"
noise = 0.9
bias_sd = 1.8
resolution = 0.18
time_constant_s = 2.0
sensor = "TC-0417"
card = "A"
role = "observed"
[[derived]]
name = "current"
quantity = "current"
unit = "A"
convention = "peak"
expression = "hypot(IdFbk, IqFbk)"
"""
    )
    assert (bench.motor, bench.specimen, bench.batch_column, bench.kind) == (
        "../motor.toml",
        "stator-07",
        "lot",
        "wltp",
    )
    assert (bench.configuration, bench.attributes, bench.join_gap_s) == ("stator_in_air", {"inverter": "sw 4.2"}, 5.0)
    assert bench.time == TimeSpec("Time", "%d.%m.%Y %H:%M:%S", None, "Europe/Rome", None, 1_719_820_800_000_000_000)
    channel, derived = bench.channels
    assert channel.name == "EW_A_3v" and channel.signal == "can2:TempA.EW_A_3v" and channel.line == 14
    assert channel.weights == {"endwinding_a_outer": 0.7, "air_a": 0.3} and channel.node is None
    assert (channel.noise, channel.bias_sd, channel.resolution) == pytest.approx((0.5, 1.0, 0.1))  # K, from degF
    assert (channel.sensor, channel.card, channel.level, channel.region) == ("TC-0417", "A", "production", "copper")
    assert (derived.name, derived.expression, derived.convention) == ("current", "hypot(IdFbk, IqFbk)", "peak")
    assert len(bench.sha256) == 64 and bench.name == "bench.toml"


def test_an_empty_bench_file_has_every_default() -> None:
    bench = read("")
    assert bench.time == TimeSpec(zone="UTC") and bench.join_gap_s == 60.0 and bench.channels == ()


def test_every_default_of_a_channel_is_filled_in_stored_units() -> None:
    channel = resolved(f'[[channel]]\nsignal = "EW_A_3v"\n{TEMPERATURE}node = "endwinding_a_outer"\n')
    assert channel == ResolvedChannel(
        name="EW_A_3v",
        quantity="temperature",
        unit="degC",
        conversion=Conversion(),
        signals=(LOG[0],),
        signal="EW_A_3v",
        role="observed",
        node="endwinding_a_outer",
        region="copper",
        noise=0.5 / 3,
        bias_sd=0.5,
        resolution=0.5,
        noise_given=False,
        line=1,
    )
    assert (channel.column, channel.stored_unit, channel.derived) == ("EW_A_3v_degC", "degC", False)


def test_noise_of_a_temperature_is_at_least_a_tenth_of_a_kelvin() -> None:
    assert resolved(f'[[channel]]\nsignal = "MAG_1"\n{TEMPERATURE}node = "magnet"\n').noise == 0.1


def test_an_input_has_no_bias_and_the_noise_of_its_steps() -> None:
    channel = resolved('[[channel]]\nsignal = "Speed"\nquantity = "speed"\nunit = "1/min"\n')
    assert (channel.role, channel.bias_sd, channel.noise, channel.resolution) == ("input", 0.0, 1 / 3, 1.0)


def test_the_resolution_of_the_database_is_converted() -> None:
    signal = [Signal("T", "M", None, "degF", 1.8)]
    channel = resolved('[[channel]]\nsignal = "T"\nquantity = "temperature"\nunit = "degF"\nnode = "n"\n', signal)
    assert channel.resolution == pytest.approx(1.0)


def test_the_smallest_step_seen_stands_in_for_an_unknown_resolution_only() -> None:
    table = [Signal("T")]
    text = f'[[channel]]\nsignal = "T"\n{TEMPERATURE}node = "magnet"\n'
    free = resolved(text, table)
    assert free.resolution is None
    assert free.with_step(0.6).resolution == 0.6
    assert free.with_step(0.6).noise == pytest.approx(0.2)
    assert resolved(text + "noise = 0.05", table).with_step(0.6).noise == 0.05
    assert resolved(text + "resolution = 0.1", table).with_step(0.6).resolution == 0.1


@pytest.mark.parametrize(
    ("node", "boundaries", "role", "bias"),
    [
        ("winding", None, "observed", 0.5),
        ("ambient_left", None, "input", 0.0),
        ("oven", None, "input", 0.0),
        ("coolant", None, "input", 0.0),
        ("coolant", [], "observed", 0.5),
        ("plate", None, "observed", 0.5),
        ("plate", ["plate"], "input", 0.0),
    ],
)
def test_temperatures_of_nodes_are_observed_and_those_of_boundaries_are_inputs(
    node: str, boundaries: list[str] | None, role: str, bias: float
) -> None:
    channel = resolved(f'[[channel]]\nsignal = "MAG_1"\n{TEMPERATURE}node = "{node}"\n', boundaries=boundaries)
    assert (channel.role, channel.bias_sd) == (role, bias)


OBSERVED = {  # quantity -> what it needs beside
    "temperature": 'node = "x"',
    "power": "",
    "heat": 'node = "coolant"',
    "resistance": 'node = "x"',
    "flux": 'node = "x"\nslope_per_K = -0.001',
}


def observed(quantity: str, more: str) -> str:
    unit = STORED_UNIT[quantity]
    return f'[[channel]]\nsignal = "Speed"\nquantity = "{quantity}"\nunit = "{unit}"\nrole = "observed"\n{more}'


@pytest.mark.parametrize("quantity", sorted(channel_tables.OBSERVABLE))
def test_what_can_be_observed_may_say_so(quantity: str) -> None:
    text = observed(quantity, OBSERVED[quantity])
    assert resolved(text).role == "observed"
    assert resolved(text.replace("observed", "input").replace("slope_per_K = -0.001", "")).role == "input"


@pytest.mark.parametrize(
    ("quantity", "gain_sd"), [("power", 0.005), ("heat", 0.03), ("resistance", 0.002), ("flux", 0.01)]
)
def test_an_observed_meter_has_a_gain_of_its_own_unless_said(quantity: str, gain_sd: float) -> None:
    text = observed(quantity, OBSERVED[quantity])
    assert resolved(text).gain_sd == gain_sd
    assert resolved(text + "\ngain_sd = 0.02").gain_sd == 0.02
    assert resolved(text.replace("observed", "input").replace("slope_per_K = -0.001", "")).gain_sd == 0.0


def test_the_reference_of_a_resistance_is_in_stored_units() -> None:
    text = observed("resistance", 'node = "x"\nreference = 12.5\nreference_degC = 25').replace('"ohm"', '"mOhm"')
    channel = resolved(text + "\nnoise = 0.01")
    assert channel.reference == pytest.approx(0.0125) and channel.noise == pytest.approx(1e-5)
    assert (channel.reference_degC, channel.slope_per_K) == (25.0, None)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (observed("power", 'node = "x"'), "an observed power is that of the whole motor: take it out."),
        (observed("heat", ""), 'an observed heat needs the boundary that takes it, such as node = "coolant".'),
        (observed("heat", "weights = {x = 1}"), "an observed heat needs the boundary that takes it"),
        (
            observed("resistance", ""),
            "an observed resistance needs a node or weights: say whose temperature it goes with.",
        ),
        (observed("flux", 'node = "x"'), "an observed flux needs slope_per_K, such as -0.001"),
        (observed("flux", 'node = "x"\nslope_per_K = 0'), "slope_per_K is 0: then the reading says nothing"),
        (
            f'[[channel]]\nsignal = "MAG_1"\n{TEMPERATURE}node = "magnet"\ngain_sd = 0.01',
            'gain_sd is of an observed power, heat, resistance or flux: add role = "observed"',
        ),
        (observed("power", "reference = 3"), 'reference is of an observed resistance or flux: add role = "observed"'),
        (observed("heat", 'node = "x"\nslope_per_K = 3'), "slope_per_K is of an observed resistance or flux"),
        (
            observed("resistance", 'node = "x"\nreference_degC = 25').replace("observed", "input"),
            "reference_degC is of an observed resistance or flux",
        ),
    ],
)
def test_a_meter_that_cannot_be_is_refused(text: str, says: str) -> None:
    with pytest.raises(BenchFileError) as error:
        read(text)
    assert says in str(error.value) and str(error.value).startswith("bench.toml:")


@pytest.mark.parametrize(
    ("node", "region"),
    [
        ("winding_a", "copper"),
        ("endwinding_b_outer", "copper"),
        ("terminal_rack", "copper"),
        ("yoke", "iron"),
        ("tooth_1", "iron"),
        ("stator", "iron"),
        ("oven", "boundary"),
        ("magnet", None),
    ],
)
def test_a_region_follows_from_the_name_of_the_node_unless_said(node: str, region: str | None) -> None:
    text = f'[[channel]]\nsignal = "MAG_1"\n{TEMPERATURE}node = "{node}"\n'
    assert resolved(text).region == region
    assert resolved(text + 'region = "housing"').region == "housing"


@pytest.mark.parametrize(
    ("node", "region", "role"), [("plate", "boundary", "input"), ("oven_wall", "other", "observed")]
)
def test_a_region_that_is_said_tells_a_boundary_where_no_motor_file_does(node: str, region: str, role: str) -> None:
    text = f'[[channel]]\nsignal = "MAG_1"\n{TEMPERATURE}node = "{node}"\nregion = "{region}"\n'
    assert resolved(text).role == role
    assert resolved(text, boundaries=["plate"]).role == ("input" if node == "plate" else "observed")


def test_the_motor_file_says_the_region_before_bench_file_and_name() -> None:
    text = f'[[channel]]\nsignal = "MAG_1"\n{TEMPERATURE}node = "winding"\n'
    assert resolved(text, boundaries=["plate"], regions={"winding": "other"}).region == "other"
    assert resolved(text + 'region = "iron"', boundaries=["plate"], regions={"winding": "other"}).region == "other"
    assert resolved(text, boundaries=["winding"], regions={"lump": "copper"}).region == "boundary"
    shared = text.replace('node = "winding"', "weights = {winding = 0.3, lump = 0.7}")
    assert resolved(shared, boundaries=[], regions={"winding": "copper", "lump": "iron"}).region == "iron"


def test_a_weighted_channel_is_observed_in_the_region_of_its_heaviest_node() -> None:
    text = f'[[channel]]\nsignal = "MAG_1"\n{TEMPERATURE}'
    for line in ("weights = {air_a = 0.3, winding = 0.7}", "node = {air_a = 0.3, winding = 0.7}"):
        channel = resolved(text + line)
        assert (channel.role, channel.region, channel.node) == ("observed", "copper", None)
        assert channel.weights == {"air_a": 0.3, "winding": 0.7}


def test_a_derived_channel_has_the_signals_of_its_expression() -> None:
    text = '[[derived]]\nname = "i"\nquantity = "current"\nunit = "A"\nexpression = "hypot(IqFbk, IdFbk) / sqrt(2)"\n'
    channel = resolved(text)
    assert channel.derived and channel.column == "i_A"
    assert channel.needs == ("IqFbk", "IdFbk") and channel.signals == (LOG[4], LOG[3])


def test_a_table_may_say_its_signals_in_any_words() -> None:
    signal = [Signal("Temp. Wicklung [°C]")]
    channel = resolved(f'[[channel]]\nsignal = "Temp. Wicklung [°C]"\n{TEMPERATURE}node = "winding"\n', signal)
    assert channel.name == "Temp. Wicklung [°C]"


SAME = [Signal("T", "A", "can1"), Signal("T", "A", "can2"), Signal("T", "B", "can1")]


@pytest.mark.parametrize(("name", "found"), [("B.T", SAME[2]), ("can2:A.T", SAME[1]), ("can1:B.T", SAME[2])])
def test_message_and_bus_tell_equal_names_apart(name: str, found: Signal) -> None:
    assert resolved(f'[[channel]]\nsignal = "{name}"\n{TEMPERATURE}node = "n"\n', SAME).signals == (found,)


def test_a_name_that_means_several_signals_is_refused_with_them() -> None:
    says = refusal(BenchFileError, f'[[channel]]\nsignal = "T"\n{TEMPERATURE}node = "n"\n', SAME)
    assert says == 'bench.toml:2: signal "T" is not unique: can1:A.T, can1:B.T, can2:A.T. Write one of these.'


def test_a_bus_ties_a_signal_that_the_database_ties_to_none() -> None:
    channel = resolved(f'[[channel]]\nsignal = "can7:TempA.EW_A_3v"\n{TEMPERATURE}node = "n"\n')
    assert channel.name == "EW_A_3v" and channel.signals[0].bus == "can7" and channel.signals[0].message == "TempA"


def test_channels_with_equal_bare_names_keep_their_whole_names() -> None:
    text = "".join(f'[[channel]]\nsignal = "{name}"\n{TEMPERATURE}node = "n"\n' for name in ("can1:A.T", "B.T"))
    assert [channel.name for channel in resolve(read(text), SAME)] == ["can1:A.T", "B.T"]


def test_an_unknown_signal_is_refused_with_the_nearest_one_and_where_it_is() -> None:
    says = refusal(BenchFileError, f'\n\n[[channel]]\nsignal = "EW_A_3V"\n{TEMPERATURE}node = "n"\n')
    assert says == (
        'bench.toml:4: signal "EW_A_3V" is not in the logs. Nearest: EW_A_3v (bench.dbc, TempA). '
        'Correct the name, add role = "ignored", or give the log that holds it in the same command.'
    )


def test_an_ignored_channel_need_not_be_in_the_logs_nor_say_what_it_is() -> None:
    assert resolve(read('[[channel]]\nsignal = "gone"\nrole = "ignored"\n'), LOG) == []
    assert resolve(read(f'[[channel]]\nsignal = "gone"\nrole = "ignored"\n{TEMPERATURE}'), LOG) == []
    assert resolved(f'[[channel]]\nsignal = "MAG_1"\nrole = "ignored"\n{TEMPERATURE}').role == "ignored"


def test_an_expression_that_names_an_unknown_signal_is_refused_with_the_nearest() -> None:
    text = '[[derived]]\nname = "i"\nquantity = "current"\nunit = "A"\nexpression = "abs(IdFbkk)"\n'
    assert refusal(BenchFileError, text) == (
        'bench.toml:5: signal "IdFbkk" in the expression of "i" is not in the logs. Nearest: IdFbk (bench.dbc, Motor). '
        "Correct the expression, or give the log that holds it in the same command."
    )


CHANNEL = f'[[channel]]\nsignal = "MAG_1"\n{TEMPERATURE}node = "magnet"\n'
ENTRY = '[[channel]] 1 (signal "MAG_1")'


@pytest.mark.parametrize(
    ("kind", "text", "says"),
    [
        (TomlError, CHANNEL.replace("node", "nod"), f'bench.toml:5: {ENTRY}: unknown key "nod". Nearest: node.'),
        (TomlError, '[[chanel]]\nsignal = "x"', 'bench.toml:1: unknown key "chanel". Nearest: channel.'),
        (TomlError, "join_gap_s = 3", 'bench.toml:1: key "join_gap_s" does not belong here: it stands under [time].'),
        (
            TomlError,
            CHANNEL + 'specimen = "x"',
            (
                f'bench.toml:6: {ENTRY}: key "specimen" does not belong here: it stands above the first [table] of the '
                "file."
            ),
        ),
        (
            TomlError,
            CHANNEL + 'noise = "0.1"',
            f"bench.toml:6: {ENTRY}: noise must be a number of 0 or more, found the text",
        ),
        (TomlError, CHANNEL + "resolution = 0", f"bench.toml:6: {ENTRY}: resolution must be a number above 0, found"),
        (TomlError, CHANNEL + "noise = true", "noise must be a number of 0 or more, found true (true or false)."),
        (TomlError, CHANNEL + "bias_sd = nan", "bias_sd must be a number of 0 or more, found the number nan."),
        (
            TomlError,
            CHANNEL + 'role = "observe"',
            'role "observe" is none of observed, input, ignored. Nearest: observed.',
        ),
        (TomlError, CHANNEL + 'level = "series"', 'level "series" is none of testing, production.'),
        (
            TomlError,
            CHANNEL.replace('"magnet"', '"Magnet"'),
            "bench.toml:5: " + ENTRY + ": node must be a name of lower-case",
        ),
        (TomlError, CHANNEL.replace('quantity = "temperature"\n', ""), f"bench.toml:1: {ENTRY}: quantity is missing"),
        (TomlError, CHANNEL.replace('unit = "degC"\n', ""), f"bench.toml:1: {ENTRY}: unit is missing"),
        (TomlError, 'kind = "wlpt"', 'bench.toml:1: kind "wlpt" is none of wltp, s1, s2,'),
        (
            TomlError,
            "attributes = {a = 3}",
            'attributes must be texts by name, such as {inverter = "sw 4.2"}, found the number 3 for "a".',
        ),
        (
            UnitError,
            CHANNEL.replace('"degC"', '"Xm"'),
            'bench.toml:4: unit "Xm" is not known for temperature; use one of degC,',
        ),
        (
            UnitError,
            CHANNEL.replace('"temperature"', '"temprature"'),
            'bench.toml:3: quantity "temprature" is not known. Nearest:',
        ),
        (UnitError, CHANNEL + 'convention = "peak"', 'bench.toml:4: convention = "peak" means nothing for temperature'),
        (
            BenchFileError,
            CHANNEL + "weights = {a = 1}",
            f"bench.toml:6: {ENTRY}: node and weights exclude each other: keep one.",
        ),
        (
            BenchFileError,
            'specimen = "a"\nspecimen_column = "b"',
            "specimen and specimen_column exclude each other: keep one.",
        ),
        (
            BenchFileError,
            '[[channel]]\nsignal = "Speed"\nquantity = "speed"\nunit = "rpm"\nrole = "observed"',
            'speed cannot be observed, only temperature, power, heat, resistance, flux: write role = "input".',
        ),
        (
            BenchFileError,
            f'[[channel]]\nsignal = "MAG_1"\n{TEMPERATURE}role = "observed"',
            "an observed temperature needs a node or weights: say what it measures.",
        ),
        (
            BenchFileError,
            CHANNEL + CHANNEL,
            'bench.toml:7: signal "MAG_1" stands here twice, first in line 1. Keep one.',
        ),
        (
            BenchFileError,
            CHANNEL + CHANNEL.replace("MAG_1", "TempB.MAG_1"),
            'bench.toml:7: signal "TempB.MAG_1" is the one of line 2 ("MAG_1"). Keep one of the two.',
        ),
    ],
)
def test_what_cannot_be_true_is_refused_at_its_line(kind: type[IngestError], text: str, says: str) -> None:
    assert says in refusal(kind, text)


DERIVED = '[[derived]]\nname = "i"\nquantity = "current"\nunit = "A"\nexpression = "IdFbk"\n'


@pytest.mark.parametrize(
    ("kind", "text", "says"),
    [
        (
            ExpressionError,
            DERIVED.replace('"IdFbk"', '"IdFbk +"'),
            'bench.toml:5: expression "IdFbk +", position 8: the expression',
        ),
        (ExpressionError, DERIVED.replace('"IdFbk"', "\"exec('x')\""), '"exec" is no function. Allowed are'),
        (TomlError, DERIVED + 'signal = "x"', 'key "signal" does not belong here: it stands in [[channel]]'),
        (TomlError, CHANNEL + 'expression = "x"', 'key "expression" does not belong here: it stands in [[derived]].'),
        (
            BenchFileError,
            DERIVED + DERIVED,
            'bench.toml:7: derived channel "i" stands here twice, first in line 1. Keep one.',
        ),
        (
            BenchFileError,
            DERIVED.replace('"i"', '"Speed"'),
            (
                'bench.toml:2: derived channel "Speed" has the name of a signal in the log, Speed (bench.dbc, Motor). '
                "Give it another"
            ),
        ),
        (
            BenchFileError,
            DERIVED.replace('"IdFbk"', '"T + 1"'),
            (
                'signal "T" in the expression of "i" is not unique: can1:A.T, can1:B.T, can2:A.T. '
                "Write one of these in backquotes."
            ),
        ),
    ],
)
def test_a_derived_channel_that_cannot_be_is_refused_at_its_line(kind: type[IngestError], text: str, says: str) -> None:
    assert says in refusal(kind, text, LOG + SAME)


@pytest.mark.parametrize(
    ("weights", "says"),
    [
        ("{a = 0.7, b = 0.2}", "weights add up to 0.9, but are shares of one channel: make them add up to 1."),
        ("{a = 1.5, b = -0.5}", "weights must be numbers above 0"),
        ("{}", "weights must be numbers above 0"),
        (
            "{A = 1.0}",
            (
                "node must be a name of lower-case letters, digits and _ that begins with a letter, in quotes, "
                'found the text "A"'
            ),
        ),
        ("[1.0]", "weights must be numbers by name"),
    ],
)
def test_weights_are_shares_of_named_nodes(weights: str, says: str) -> None:
    assert says in refusal(IngestError, CHANNEL.replace('node = "magnet"', f"weights = {weights}"))


@pytest.mark.parametrize(
    ("time", "says"),
    [
        (
            'zone = "Europe/Roma"',
            'bench.toml:2: [time]: zone "Europe/Roma" is no time zone of the IANA list. Nearest: Europe/Rome.',
        ),
        ('zone = "Europe"', 'zone "Europe" is no time zone of the IANA list.'),
        ('zone = "../../etc/passwd"', "is no time zone of the IANA list. Write it as Europe/Rome."),
        ('column = "t"\nrate_hz = 1', "column and rate_hz exclude each other: keep one."),
        ('format = "%H"\nunit = "s"', "format and unit exclude each other: keep one."),
        ('unit = "s"\nrate_hz = 1', "unit and rate_hz exclude each other: keep one."),
        ('format = "%d.%Q"', 'format "%d.%Q" is no strptime format. Write it as "%d.%m.%Y %H:%M:%S".'),
        ('format = "dd.mm.yyyy"', 'format "dd.mm.yyyy" is no strptime format.'),
        ('unit = "sec"', 'unit "sec" is none of s, ms, us, ns, min, h.'),
        ("rate_hz = 0", "rate_hz must be a number above 0, found the number 0."),
        ('start = "2024-03-01"', "start must be a date and time without quotes, such as 2024-03-01T08:00:00Z"),
        ("start = 0001-01-01T00:00:00+14:00", "is out of range: it must lie between 1971 and 2200."),
        ('motor = "m.toml"', 'key "motor" does not belong here: it stands above the first [table] of the file.'),
    ],
)
def test_a_time_that_cannot_be_is_refused(time: str, says: str) -> None:
    assert says in refusal(IngestError, f"[time]\n{time}")


@pytest.mark.parametrize(
    ("time", "start"),
    [
        ("start = 2024-03-01T08:00:00Z", "2024-03-01T08:00:00Z"),
        ("start = 2024-03-01T08:00:00+01:00", "2024-03-01T07:00:00Z"),
        ("start = 2024-03-01T08:00:00.5", "2024-03-01T08:00:00.500000Z"),
        ('zone = "Europe/Rome"\nstart = 2024-03-01T08:00:00', "2024-03-01T07:00:00Z"),
    ],
)
def test_a_start_without_offset_is_local_time_of_the_zone(time: str, start: str) -> None:
    assert read(f"[time]\n{time}").time.start_ns == utc_ns(datetime.fromisoformat(start))


@pytest.mark.parametrize(
    ("logger", "says"),
    [
        ('name = "thermo"', "files is missing: it must be a text in quotes."),
        ('name = "T 1"\nfiles = "*"', "name must be a name of lower-case letters, digits and _"),
        ('name = "can2"\nfiles = "*"', 'name "can2" is what a bus is called: choose another.'),
        ('name = "a"\nfiles = "*"\nzone = "Europe/Roma"', "Nearest: Europe/Rome."),
        ('name = "a"\nfiles = "*"\njoin_gap_s = 3', 'unknown key "join_gap_s".'),
    ],
)
def test_a_logger_that_cannot_be_is_refused(logger: str, says: str) -> None:
    assert says in refusal(IngestError, f"[[logger]]\n{logger}")


def test_a_log_is_of_the_first_logger_that_its_name_fits_and_its_stamps_are_read_as_that_says() -> None:
    bench = read(
        '[time]\nzone = "Asia/Tokyo"\n[time.csv]\nzone = "Europe/Rome"\n'
        '[[logger]]\nname = "thermo"\nfiles = "Thermo_?.*"\nunit = "ms"\n'
        '[[logger]]\nname = "power"\nfiles = "*_?.csv"\n'
    )
    names = ("thermo_1.CSV", "thermo_1.csv in day.zip", "POWER_2.csv", "thermo_12.csv", "drive.csv")
    found = [bench.logger_of(name) for name in names]
    assert [one.name if one else None for one in found] == ["thermo", "thermo", "power", None, None]
    assert bench.time_for("csv", "thermo_1.CSV") == TimeSpec(unit="ms")
    assert bench.time_for("csv", "POWER_2.csv").zone == bench.time_for("csv", "drive.csv").zone == "Europe/Rome"
    assert bench.time_for("blf", "drive.blf").zone == "Asia/Tokyo"


@pytest.mark.parametrize("heading", ["### What may be observed", "## `[[change]]`", "## `[[derating]]`"])
def test_the_entries_on_the_page_are_read(heading: str) -> None:
    page = (PACKAGE.parent / "docs" / "bench_file.md").read_text(encoding="utf-8")
    block = page.partition(f"{heading}\n")[2].partition("```toml\n")[2].partition("```")[0]
    assert block.startswith("[[")
    tables = [f'[[channel]]\nsignal = "{name}"\n{TEMPERATURE}node = "winding"\n' for name in ("NTC", "T3", "Tmag")]
    read("".join(tables) + block)


WATCHED = f'[[channel]]\nsignal = "TempB.MAG_1"\n{TEMPERATURE}node = "magnet"\n'


@pytest.mark.parametrize("name", ["MAG_1", "TempB.MAG_1"])
def test_a_derating_watches_a_thermometer_of_the_bench(name: str) -> None:
    bench = read(f'{WATCHED}[[derating]]\nchannel = "{name}"\nbegin_degC = 120\nend_degC = 140.5\n')
    assert bench.deratings == (DeratingRule("MAG_1", 120.0, 140.5),)


@pytest.mark.parametrize(
    ("derating", "says"),
    [
        (
            'channel = "MAG_2"\nbegin_degC = 1\nend_degC = 2',
            'channel "MAG_2" is no temperature of this bench. Nearest: ',
        ),
        ('channel = "MAG_1"\nbegin_degC = 9\nend_degC = 9', "end_degC 9 is not above begin_degC 9: the current falls"),
        ('channel = "MAG_1"\nbegin = 9\nend_degC = 9', 'unknown key "begin". Nearest: begin_degC.'),
        ('channel = "MAG_1"\nbegin_degC = 9', "end_degC is missing: it must be a number."),
    ],
)
def test_a_derating_that_cannot_be_is_refused(derating: str, says: str) -> None:
    with pytest.raises(IngestError) as error:
        read(f"{WATCHED}[[derating]]\n{derating}\n")
    assert says in str(error.value) and str(error.value).startswith("bench.toml:")


def test_a_unit_row_of_a_table_that_disagrees_is_refused_with_the_name_of_its_log() -> None:
    bench = read(CHANNEL)
    with pytest.raises(BenchFileError) as error:
        refuse_unit_row(bench, {"MAG_1": "K"}, "wed.csv")
    assert str(error.value) == (
        'bench.toml:4: unit "degC" of signal "MAG_1" disagrees with wed.csv, which says "K". '
        "Correct the bench file, or give that log one of its own."
    )
    refuse_unit_row(bench, {"MAG_1": "°C", "other": "K"}, "wed.csv")
    assert resolved(CHANNEL, [Signal("MAG_1", "M", unit="K")]).name == "MAG_1"  # a database may be wrong


def test_a_column_of_several_tables_is_one_signal() -> None:
    assert resolved(CHANNEL, [Signal("MAG_1"), Signal("MAG_1", unit="°C")]).name == "MAG_1"
    assert "is not unique: M.MAG_1, rows.MAG_1." in refusal(
        BenchFileError, CHANNEL, [Signal("MAG_1"), Signal("MAG_1", "M")]
    )


def test_amplitudes_are_converted_with_their_noise() -> None:
    text = '[[channel]]\nsignal = "IdFbk"\nquantity = "current_d"\nunit = "A"\nconvention = "peak"\nnoise = 1.0\n'
    channel = resolved(text)
    assert channel.conversion(np.array([math.sqrt(2)]))[0] == pytest.approx(1.0)
    assert channel.noise == pytest.approx(1 / math.sqrt(2))


def test_pure_numbers_need_no_unit() -> None:
    assert one('[[channel]]\nsignal = "n"\nquantity = "counter"\n').unit == "1"


def test_nodes_that_the_motor_does_not_have_are_refused_with_the_nearest() -> None:
    nodes, boundaries = ["magnet", "winding"], ["coolant"]
    check_nodes(read(CHANNEL), nodes, boundaries)
    check_nodes(read(CHANNEL.replace('"magnet"', '"else"') + 'role = "ignored"'), nodes, boundaries)
    with pytest.raises(BenchFileError) as caught:
        check_nodes(read(CHANNEL.replace('"magnet"', '"magnt"')), nodes, boundaries)
    assert (
        str(caught.value) == 'bench.toml:5: node "magnt" of signal "MAG_1" is not in the motor file. Nearest: magnet.'
    )
    with pytest.raises(BenchFileError, match=r'bench.toml:5: node "x" of signal .* It has: magnet, winding, coolant.'):
        check_nodes(read(CHANNEL.replace('node = "magnet"', "weights = {winding = 0.5, x = 0.5}")), nodes, boundaries)


@pytest.mark.parametrize("key", ["weights", "node"])
@pytest.mark.parametrize("shares", ["{magnet = 0.5, coolant = 0.5}", "{coolant = 1.0}"])
def test_a_boundary_among_weights_is_refused(key: str, shares: str) -> None:
    text = CHANNEL.replace('node = "magnet"', f"{key} = {shares}")
    with pytest.raises(BenchFileError) as caught:
        check_nodes(read(text), ["magnet"], ["coolant"])
    assert str(caught.value) == (
        f'bench.toml:5: {key} of signal "MAG_1" hold "coolant", a boundary, but weights are of nodes only. '
        'Take it out, or write node = "coolant" alone.'
    )
    check_nodes(read(text + 'role = "ignored"'), ["magnet"], ["coolant"])
    check_nodes(read(CHANNEL.replace("magnet", "coolant")), ["magnet"], ["coolant"])


def test_the_example_of_the_published_motor_fits_its_recordings() -> None:
    bench = read_bench((EXAMPLE / "bench.toml").read_bytes(), "bench.toml")
    with gzip.open(EXAMPLE / "id_1.csv.gz", "rt", encoding="utf-8") as file:
        header = next(csv.reader(file))
    channels = {channel.name: channel for channel in resolve(bench, [Signal(name) for name in header])}
    used = {signal.name for channel in channels.values() for signal in channel.signals}
    assert used == set(header)
    roles = {name: channel.role for name, channel in channels.items() if channel.role != "ignored"}
    observed = {name for name, role in roles.items() if role == "observed"}
    assert observed == {"winding", "stator", "rotor"}
    assert {channels[name].node for name in ("water_outlet", "ambient")} == {"coolant", "ambient"}
    check_nodes(bench, ["winding", "stator", "rotor"], ["coolant", "ambient"])
    assert bench.time.rate_hz == 1.0 and bench.specimen == "hust-ipmsm" and bench.motor == "motor.toml"
    current = channels["current"]
    assert current.formula is not None
    feedback = {"IdFbk": np.array([-3.0]), "IqFbk": np.array([4.0])}
    assert current.conversion(current.formula.evaluate(feedback))[0] == pytest.approx(5 / math.sqrt(2))


def keys(schema: dict[str, Any]) -> set[str]:
    assert schema["additionalProperties"] is False
    return set(schema["properties"])


def test_the_schema_lists_exactly_the_keys_that_are_read() -> None:
    properties = SCHEMA["properties"]
    assert keys(SCHEMA) == {"schema", *bench_module.ROOT_KEYS}
    assert keys(properties["time"]) == {*TIME_KEYS, "join_gap_s", *OF_FORMAT}
    assert keys(properties["logger"]["items"]) == {*LOGGER_KEYS, *TIME_KEYS}
    assert keys(properties["channel"]["items"]) == set(channel_tables.CHANNEL_KEYS)
    assert keys(properties["derived"]["items"]) == set(channel_tables.DERIVED_KEYS)
    assert keys(properties["change"]["items"]) == set(CHANGE_KEYS)
    assert keys(properties["derating"]["items"]) == set(DERATING_KEYS)


def test_the_schema_lists_exactly_the_choices_that_are_read() -> None:
    found = {
        key: tuple(SCHEMA["definitions"][key]["enum"]) for key in ("quantity", "region", "level", "convention", "role")
    }
    assert found == {
        "quantity": tuple(STORED_UNIT),
        "region": channel_tables.REGIONS,
        "level": channel_tables.LEVELS,
        "convention": CONVENTIONS,
        "role": channel_tables.ROLES,
    }
    assert tuple(SCHEMA["properties"]["kind"]["enum"]) == bench_module.KINDS
    assert tuple(SCHEMA["properties"]["time"]["properties"]["unit"]["enum"]) == TIME_UNITS
    assert SCHEMA["properties"]["schema"]["const"] == bench_module.SCHEMA


def test_the_schema_in_the_documentation_is_the_shipped_one() -> None:
    page = PACKAGE.parent / "docs" / "schema" / "bench.schema.json"
    reference = json.loads(page.read_text(encoding="utf-8"))["$ref"]
    assert (page.parent / reference).resolve() == PACKAGE / "schema" / "bench.schema.json"


@pytest.mark.parametrize(("table", "untimed"), [('specimen_column = "serial"\n', True), ("", False)])
def test_only_a_table_of_checks_with_a_row_a_specimen_may_be_without_time(table: str, untimed: bool) -> None:
    row = f'{table}[[channel]]\nsignal = "R"\nquantity = "thermal_resistance"\nunit = "K/W"\n'
    assert read('schema = "whyhot.bench/1"\n' + row).time.untimed is untimed
