"""The `[[correction]]` tables of a bench file: what may stand there, what each law takes off, and in which order."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

import ingest
from ingest.bench import corrections as corrections_module
from ingest.bench.bench_file import Bench, read_bench
from ingest.bench.corrections import Correction, correct, true_times, true_values
from ingest.bench.laws import LAWS, MASKED, Surroundings
from ingest.errors import BenchFileError, TomlError

BENCH = """\
schema = "whyhot.bench/1"
[[channel]]
signal = "can1:Temps.MAG_1"
quantity = "temperature"
unit = "degC"
node = "magnet"
time_constant_s = 2.0
[[channel]]
signal = "MAG 2"
quantity = "temperature"
unit = "degC"
node = "magnet"
[[channel]]
signal = "TC_teeth"
quantity = "temperature"
unit = "degC"
node = "teeth"
region = "iron"
[[channel]]
signal = "EW_gap"
quantity = "temperature"
unit = "degC"
weights = {air_a = 0.3, endwinding_a = 0.7}
[[channel]]
signal = "Inlet"
quantity = "temperature"
unit = "degC"
node = "coolant"
[[channel]]
signal = "Room"
quantity = "temperature"
unit = "degC"
node = "ambient"
[[channel]]
signal = "flow_jacket"
quantity = "flow"
unit = "l/min"
[[channel]]
signal = "flow_rotor"
quantity = "flow"
unit = "l/min"
[[derived]]
name = "current"
quantity = "current"
unit = "A"
expression = "hypot(Id, Iq)"
[[channel]]
signal = "spare"
quantity = "temperature"
unit = "degC"
node = "yoke"
role = "ignored"
"""
MAG_1, MAG_2, TEETH, GAP, INLET, ROOM, JACKET, ROTOR, SPARE, CURRENT = range(10)  # derived channels stand last
HEAD = BENCH.count("\n")


def bench(*tables: tuple[str, float], text: str = BENCH) -> Bench:
    written = "".join(f'[[correction]]\ncause = "{cause}"\namount = {amount}\n' for cause, amount in tables)
    return read_bench((text + written).encode(), "bench.toml")


def refusal(*tables: tuple[str, float], text: str = BENCH) -> str:
    with pytest.raises(BenchFileError) as caught:
        bench(*tables, text=text)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def concerned(cause: str, amount: float = 0.1) -> list[int]:
    """Positions of the channels that a correction is taken off."""
    read = bench((cause, amount))
    steps = correct(read.name, read.channels, read.corrections).steps
    return [i for i, some in enumerate(steps) if some]


def test_a_bench_file_without_corrections_has_none() -> None:
    assert bench().corrections == ()


def test_corrections_are_read_with_cause_amount_and_line() -> None:
    read = bench(("sensor.teeth.bias", 3.1), ("clock.can2.offset", -2))
    assert read.corrections == (Correction("sensor.teeth.bias", 3.1), Correction("clock.can2.offset", -2.0))
    assert [one.line for one in read.corrections] == [HEAD + 2, HEAD + 5]
    assert (read.corrections[0].kind, read.corrections[0].place, read.corrections[0].law) == ("sensor", "teeth", "bias")


@pytest.mark.parametrize(
    ("cause", "channels"),
    [
        ("sensor.teeth.bias", [TEETH]),
        ("sensor.teeth@TC_teeth.gain", [TEETH]),
        ("sensor.magnet@MAG_1.drift", [MAG_1]),
        ("sensor.magnet@can1_Temps_MAG_1.drift", [MAG_1]),
        ("sensor.magnet@MAG_2.stem", [MAG_2]),
        ("sensor.endwinding_a@EW_gap.bias", [GAP]),
        ("sensor.air_a@EW_gap.bias", [GAP]),
        ("boundary.coolant.bias", [INLET]),
        ("input.current.gain", [CURRENT]),
        ("input.flow.bias", [JACKET, ROTOR]),
        ("input.flow_rotor.gain", [ROTOR]),
        ("input.flow_gearbox.gain", [JACKET, ROTOR]),
        ("clock.can1.drift", []),
    ],
)
def test_a_place_leads_to_the_channels_that_go_by_it(cause: str, channels: list[int]) -> None:
    assert concerned(cause) == channels


@pytest.mark.parametrize(
    ("cause", "amount", "says"),
    [
        ("sensor.bias", 1, "is no cause: write kind.place.law, such as sensor.magnet.bias."),
        ("sensr.teeth.bias", 1, "is of no kind that a bench has: sensor, clock, input, boundary. Nearest: sensor."),
        (
            "loss.magnet.speed1.5",
            1,
            "is of the motor, not of the bench: a loss belongs in the motor file.",
        ),
        ("input.flow.gian", 1, "has a law that no input has: gain, bias. Nearest: gain."),
        ("input.flow.undersampled", 1, "has a law that no input has: gain, bias."),
        (
            "sensor.teth.bias",
            1,
            'names a place that this bench does not have: no channel measures "teth". Nearest: teeth.',
        ),
        (
            "sensor.yoke.bias",
            1,
            (
                'no channel measures "yoke". There are: air_a@EW_gap, ambient, ambient@Room, coolant, coolant@Inlet, '
                "endwinding_a, endwinding_a@EW_gap, magnet,"
            ),
        ),
        ("boundary.coolent.bias", 1, 'no channel measures "coolent". Nearest: coolant.'),
        ("input.currnt.gain", 1, 'no input gives "currnt". Nearest: current.'),
        ("input.temperature.bias", 1, 'no input gives "temperature". There are: current, flow.'),
        (
            "clock.can 2.offset",
            1,
            "names no clock: write a bus such as can2, a [[logger]], or the stem of a log's name.",
        ),
        (
            "sensor.magnet.bias",
            1,
            'may mean several sensors of "magnet": write one of magnet@MAG_1, magnet@can1_Temps_MAG_1, magnet@MAG_2.',
        ),
        ("sensor.teeth.swap_magnet", 1, 'may mean several sensors of "magnet"'),
        ("sensor.teeth.swap_teeth", 1, "exchanges a sensor with itself: name two."),
        ("sensor.teeth.swap_magnet@MAG_2", 2, "is there or not: its amount must be 1, found 2."),
        ("sensor.teeth.hold", 0.3, "is there or not: its amount must be 1, found 0.3."),
        ("sensor.teeth.gain", -1, "its amount must be above -1, found -1."),
        ("sensor.teeth.stem", 1, "its amount must be below 1, found 1."),
        ("sensor.ambient.stem", 0.1, "is of the ambient itself: take it out."),
        ("sensor.magnet@MAG_1.lag", -3, 'leaves a lag of -1 s: signal "can1:Temps.MAG_1" has 2 s.'),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(cause: str, amount: float, says: str) -> None:
    found = refusal((cause, amount))
    assert found.startswith(f'bench.toml:{HEAD + 2}: correction "{cause}" ')
    assert says in found


def test_a_stem_needs_the_channel_of_the_ambient() -> None:
    text = BENCH.replace('node = "ambient"', 'node = "oven"')
    assert 'add the channel that measures it, with node = "ambient".' in refusal(("sensor.teeth.stem", 0.1), text=text)


def test_an_unknown_key_or_a_missing_amount_is_refused() -> None:
    with pytest.raises(TomlError, match=r'\[\[correction\]\] 1: unknown key "amnt". Nearest: amount.'):
        read_bench((BENCH + '[[correction]]\ncause = "sensor.teeth.bias"\namnt = 1').encode(), "bench.toml")
    with pytest.raises(TomlError, match="amount is missing: it must be a number"):
        read_bench((BENCH + '[[correction]]\ncause = "sensor.teeth.bias"').encode(), "bench.toml")


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ("sensor.teeth.bias", "sensor.teeth@TC_teeth.bias"),
        ("sensor.coolant.bias", "boundary.coolant.bias"),
        ("clock.can2.offset", "clock.can2.offset"),
        ("sensor.teeth.hold", "sensor.teeth.hold"),
    ],
)
def test_what_says_the_same_of_the_same_channel_stands_once(first: str, second: str) -> None:
    assert refusal((first, 1.0), (second, 1.0)) == (
        f'bench.toml:{HEAD + 5}: correction "{second}" is the correction of line {HEAD + 2}: keep one.'
    )


def test_the_same_law_may_stand_for_two_clocks() -> None:
    assert len(bench(("clock.can1.offset", 1.0), ("clock.can2.offset", 2.0)).corrections) == 2


def test_exchanged_sensors_measure_each_others_nodes_and_keep_the_rest() -> None:
    read = bench(("sensor.teeth.swap_endwinding_a@EW_gap", 1.0))
    now = correct(read.name, read.channels, read.corrections)
    teeth, gap = now.channels[TEETH], now.channels[GAP]
    assert (teeth.signal, teeth.node, teeth.weights, teeth.region) == (
        "TC_teeth",
        None,
        {"air_a": 0.3, "endwinding_a": 0.7},
        None,
    )
    assert (gap.signal, gap.node, dict(gap.weights), gap.region) == ("EW_gap", "teeth", {}, "iron")
    assert read.channels[TEETH].node == "teeth"


def test_an_exchange_names_what_those_above_it_left() -> None:
    read = bench(("sensor.teeth.swap_magnet@MAG_2", 1.0), ("sensor.teeth.swap_magnet@MAG_1", 1.0))
    nodes = [one.node for one in correct(read.name, read.channels, read.corrections).channels]
    assert (nodes[MAG_1], nodes[MAG_2], nodes[TEETH]) == ("teeth", "magnet", "magnet")


def test_below_an_exchange_a_place_is_called_what_it_is_called_then() -> None:
    swap = ("sensor.teeth.swap_coolant", 1.0)
    before, after = bench(("sensor.teeth.bias", 1.0), swap), bench(swap, ("sensor.teeth.bias", 1.0))
    steps = [correct(one.name, one.channels, one.corrections).steps for one in (before, after)]
    assert [len(steps[0][i]) for i in (TEETH, INLET)] == [1, 0]
    assert [len(steps[1][i]) for i in (TEETH, INLET)] == [0, 1]


def test_a_bias_of_either_sensor_may_stand_on_both_sides_of_their_exchange() -> None:
    bias = ("sensor.teeth.bias", 1.0)
    assert len(bench(bias, ("sensor.teeth.swap_coolant", 1.0), bias).corrections) == 3


def test_a_lag_is_added_to_the_time_constant() -> None:
    read = bench(("sensor.magnet@MAG_1.lag", 5.5))
    assert correct(read.name, read.channels, read.corrections).channels[MAG_1].time_constant_s == 7.5


@pytest.mark.parametrize("law", MASKED)
def test_a_masked_fault_changes_nothing(law: str) -> None:
    read = bench((f"sensor.teeth.{law}", 1))
    now = correct(read.name, read.channels, read.corrections)
    assert now.channels == read.channels
    assert not any(now.steps)


def test_each_law_is_taken_off_as_it_was_put_on() -> None:
    truth, hours, ambient = np.array([20.0, 90.0, 150.0]), np.array([0.0, 0.5, 2.0]), np.array([20.0, 22.0, 25.0])
    speed, current = np.array([0.0, 4000.0, 12000.0]), np.array([300.0, 0.0, 150.0])
    forward = {
        "bias": truth + 3.1,
        "gain": truth * 1.05,
        "drift": truth + 2.5 * hours,
        "stem": truth + 0.08 * (ambient - truth),
        "speed": truth - 0.4 * speed / 1000.0,
        "current": truth + 1.5 * current / 100.0,
    }
    amounts = {"bias": 3.1, "gain": 0.05, "drift": 2.5, "stem": 0.08, "speed": -0.4, "current": 1.5}
    beside = Surroundings(hours, {"ambient": ambient, "speed": speed, "current": current})
    for law, reading in forward.items():
        found = true_values(reading, [Correction(f"sensor.teeth.{law}", amounts[law])], beside)
        assert found == pytest.approx(truth, abs=1e-12), law


def test_steps_are_taken_off_one_after_the_other() -> None:
    steps = [Correction("sensor.teeth.bias", 2.0), Correction("sensor.teeth.gain", 0.5)]
    assert true_values(np.array([32.0]), steps, Surroundings(np.zeros(1))) == pytest.approx([20.0])
    assert true_values(np.array([32.0]), steps[::-1], Surroundings(np.zeros(1))) == pytest.approx([32.0 / 1.5 - 2.0])


def test_heat_along_the_leads_stays_in_where_the_ambient_is_not_known() -> None:
    steps = [Correction("sensor.teeth.stem", 0.1), Correction("sensor.teeth.bias", 2.0)]
    assert true_values(np.array([50.0]), steps, Surroundings(np.zeros(1))) == pytest.approx([48.0])


def test_stamps_lose_what_the_clock_of_their_bus_is_late_by() -> None:
    start = 1_760_000_000_000_000_000
    truth = start + np.array([0, 1_000_000_000, 3_600_000_000_000])
    late = truth + 2_500_000_000
    fast = truth + np.rint((truth - start) * 400e-6).astype(np.int64)
    offset, drift = Correction("clock.can2.offset", 2.5), Correction("clock.can2.drift", 400.0)
    assert true_times(late, [offset], "can2", start).tolist() == truth.tolist()
    assert np.abs(true_times(fast, [drift], "can2", start) - truth).max() <= 1
    assert true_times(late, [offset, drift], "can1", start).tolist() == late.tolist()
    assert true_times(late, [Correction("clock.monday_am.offset", 2.5)], "monday am", start).tolist() == truth.tolist()


@pytest.mark.parametrize("law", ["bias", "gain", "drift", "stem", "speed", "current"])
def test_two_amounts_composed_are_one_after_the_other(law: str) -> None:
    reading, ambient = np.array([40.0, 120.0]), np.array([22.0, 24.0])
    inputs = {"speed": np.array([0.0, 9000.0]), "current": np.array([20.0, 250.0])}
    beside = Surroundings(np.array([0.5, 3.0]), {"ambient": ambient, **inputs})
    one, two = Correction(f"sensor.teeth.{law}", 0.04), Correction(f"sensor.teeth.{law}", 0.07)
    both = Correction(f"sensor.teeth.{law}", LAWS["sensor"][law].both(0.04, 0.07))
    expected = true_values(reading, [one, two], beside)
    assert true_values(reading, [both], beside) == pytest.approx(expected, rel=1e-14)


def test_the_page_of_the_bench_file_has_a_row_for_every_law() -> None:
    page = (Path(ingest.__file__).parents[1] / "docs" / "bench_file.md").read_text(encoding="utf-8")
    rows = [line for line in page.splitlines() if re.match(r"\| `(sensor|clock|input|boundary)\.", line)]
    for kind, laws in LAWS.items():
        for law in laws:
            assert any(row.startswith(f"| `{kind}.") and f".{law}`" in row.split("|")[1] for row in rows), (kind, law)


def test_the_schema_takes_what_is_read() -> None:
    path = Path(ingest.__file__).parent / "schema" / "bench.schema.json"
    items = json.loads(path.read_text(encoding="utf-8"))["properties"]["correction"]["items"]
    assert set(items["properties"]) == set(corrections_module.KEYS)
    assert items["required"] == ["cause", "amount"]
    pattern = items["properties"]["cause"]["pattern"]
    assert all(re.search(pattern, f"{kind}.magnet@MAG_1.bias") for kind in LAWS)
    assert not re.search(pattern, "loss.magnet.speed2")
