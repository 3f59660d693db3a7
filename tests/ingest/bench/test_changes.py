"""The `[[change]]` tables of a bench file: what a channel means from a date on, and corrections with dates."""

from __future__ import annotations

from datetime import UTC, datetime

import numpy as np
import pytest

from ingest.bench.bench_file import Bench, read_bench
from ingest.bench.resolving import resolve
from ingest.bench.signals import Signal
from ingest.errors import IngestError
from ingest.formats import utc_ns

BENCH = """\
schema = "whyhot.bench/1"
[time]
zone = "Europe/Rome"
[[channel]]
signal = "T3"
quantity = "temperature"
unit = "degC"
node = "winding"
region = "copper"
noise = 0.2
sensor = "TC-1"
[[channel]]
signal = "can1:Temps.Tmag"
quantity = "temperature"
unit = "degC"
node = "magnet"
[[channel]]
signal = "Rotor No. 1"
quantity = "temperature"
unit = "degC"
node = "rotor"
[[derived]]
name = "mean"
quantity = "temperature"
unit = "degC"
expression = "(T3 + `can1:Temps.Tmag`) / 2"
"""
LAST = BENCH.count("\n")
MOVED = '[[change]]\nfrom = 2025-02-11\nchannel = "T3"\nnode = "yoke"\nsensor = "TC-7"\nreason = "refitted"\n'
RENAMED = '[[change]]\nfrom = 2025-03-01T08:00:00Z\nchannel = "Tmag"\nsignal = "can1:Temps.Rotor_Magnet"\n'
BEFORE, AFTER, LATE = (utc_ns(datetime(2025, month, 20, tzinfo=UTC)) for month in (1, 2, 3))


def read(*tables: str) -> Bench:
    return read_bench((BENCH + "".join(tables)).encode(), "bench.toml")


def refusal(*tables: str) -> str:
    with pytest.raises(IngestError) as caught:
        read(*tables)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_a_channel_is_at_another_place_from_a_date_on_and_keeps_its_name() -> None:
    bench = read(MOVED)
    before, after = (bench.at(t_ns).channels[0] for t_ns in (BEFORE, AFTER))
    assert (before.node, before.sensor, before.region) == ("winding", "TC-1", "copper")
    assert (after.node, after.sensor, after.region) == ("yoke", "TC-7", None)
    assert before.name == after.name == "T3" and after.noise == 0.2
    assert bench.changes[0].says == "T3: node yoke (was winding), region not given (was copper), sensor TC-7 (was TC-1)"


def test_a_date_is_its_midnight_in_the_zone_of_the_file() -> None:
    bench = read(MOVED)
    midnight = utc_ns(datetime(2025, 2, 10, 23, tzinfo=UTC))
    assert bench.changes[0].from_ns == midnight
    assert [bench.at(t_ns).channels[0].node for t_ns in (midnight - 1, midnight)] == ["winding", "yoke"]


def test_a_log_without_a_date_is_from_before_all_changes() -> None:
    assert read(MOVED).at(None).channels[0].node == "winding"


def test_a_later_change_stands_on_an_earlier_one_whatever_their_order_in_the_file() -> None:
    back = '[[change]]\nfrom = 2025-03-01\nchannel = "T3"\nsensor = "TC-9"\n'
    for tables in ((MOVED, back), (back, MOVED)):
        late = read(*tables).at(LATE).channels[0]
        assert (late.node, late.sensor) == ("yoke", "TC-9")


def test_a_renamed_signal_is_the_same_channel_and_expressions_follow_it() -> None:
    bench = read(RENAMED)
    old = [Signal("T3"), Signal("Tmag", "Temps", "can1"), Signal("Rotor No. 1")]
    new = [Signal("T3"), Signal("Rotor_Magnet", "Temps", "can1"), Signal("Rotor No. 1")]
    for t_ns, signals in ((BEFORE, old), (LATE, new)):
        found = {one.name: one for one in resolve(bench.at(t_ns), signals)}
        assert found["Tmag"].signals == (signals[1],) and found["mean"].signals == (signals[0], signals[1])
    assert resolve(bench.at(LATE), new)[1].column == "Tmag_degC"


def test_a_renamed_column_keeps_its_whole_first_name() -> None:
    renamed = '[[change]]\nfrom = 2025-02-11\nchannel = "Rotor No. 1"\nsignal = "Rotor 1"\n'
    signals = [Signal("T3"), Signal("Tmag", "Temps", "can1"), Signal("Rotor 1")]
    names = [one.name for one in resolve(read(renamed).at(AFTER), signals)]
    assert names == ["T3", "Tmag", "Rotor No. 1", "mean"]


def test_another_unit_leaves_noise_what_it_is() -> None:
    other = '[[change]]\nfrom = 2025-02-11\nchannel = "T3"\nunit = "degF"\n'
    channel = read(other).at(AFTER).channels[0]
    assert channel.unit == "degF" and channel.noise == 0.2  # K, as stored
    [spec, *_] = resolve(read(other).at(AFTER), [Signal("T3"), Signal("Tmag", "Temps", "can1"), Signal("Rotor No. 1")])
    assert spec.conversion(np.array([212.0]))[0] == pytest.approx(100.0)


def test_what_is_learnt_of_a_bench_ends_with_a_sensor_not_with_a_name() -> None:
    bench = read(MOVED, RENAMED)
    moved = bench.changes[0].from_ns
    assert [bench.unchanged(t_ns) for t_ns in (None, BEFORE, AFTER, LATE)] == [
        (None, moved),
        (None, moved),
        (moved, None),
        (moved, None),
    ]


def test_a_correction_holds_between_its_dates() -> None:
    bias = '[[correction]]\ncause = "sensor.winding.bias"\namount = 2.0\n'
    bench = read(bias + "from = 2025-02-01\nuntil = 2025-03-01\n", bias.replace("2.0", "0.5"))
    assert [[one.amount for one in bench.at(t_ns).corrections] for t_ns in (BEFORE, AFTER, LATE)] == [
        [0.5],
        [2.0, 0.5],
        [0.5],
    ]


def test_a_correction_is_of_the_place_that_a_sensor_has_while_it_holds() -> None:
    yoke = '[[correction]]\ncause = "sensor.yoke.bias"\namount = 2.0\n'
    assert read(MOVED, yoke + "from = 2025-02-11\n").at(AFTER).corrections[0].amount == 2.0
    says = refusal(MOVED, yoke)
    assert 'no channel measures "yoke"' in says


@pytest.mark.parametrize(
    ("table", "says"),
    [
        ('channel = "T3"\nnode = "yoke"', "from is missing: it must be a date, or a date and time, without quotes"),
        ('from = "2025-02-11"\nchannel = "T3"\nnode = "yoke"', "without quotes, such as 2024-03-01 or 2024-03-01T08"),
        ("from = 1950-01-01\nchannel = 'T3'\nnode = 'yoke'", "from 1950-01-01 is out of range"),
        ('from = 2025-02-11\nchannel = "T4"\nnode = "yoke"', 'channel "T4" is none of this file. There are: T3, can1:'),
        ('from = 2025-02-11\nchannel = "T3"', "changes nothing: say what is other from then on, such as node"),
        ('from = 2025-02-11\nchannel = "T3"\nquantity = "speed"', "of another quantity it is another channel"),
        ('from = 2025-02-11\nchannel = "T3"\nplace = "yoke"', 'unknown key "place".'),
        ('from = 2025-02-11\nchannel = "T3"\nnode = "a"\nweights = {b = 1.0}', "node and weights exclude each other"),
        ('from = 2025-02-11\nchannel = "T3"\nunit = "kg"', "kg"),
        ('from = 2025-02-11\nchannel = "T3"\nsignal = "Rotor No. 1"', "stands here twice, first in line"),
        ('from = 2025-02-11\nchannel = "mean"\nexpression = "T3 +"', "bench.toml:"),
    ],
)
def test_a_change_that_cannot_be_is_refused_in_one_line(table: str, says: str) -> None:
    told = refusal(f"[[change]]\n{table}\n")
    assert says in told and told.startswith("bench.toml:") and int(told.split(":")[1]) > LAST - 10


def test_two_changes_of_one_channel_at_one_moment_are_refused() -> None:
    assert f"line {LAST + 1} changes it at the same moment: put both together." in refusal(MOVED, MOVED)


@pytest.mark.parametrize("until", ["2025-02-01", "2025-03-01"])
def test_a_correction_that_never_holds_is_refused(until: str) -> None:
    dates = f"from = 2025-03-01\nuntil = {until}\n"
    says = refusal(f'[[correction]]\ncause = "sensor.winding.bias"\namount = 2.0\n{dates}')
    assert says.endswith("until is not after from: then it never holds.")
