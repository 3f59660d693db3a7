"""Corrections written into a bench file: appended where they are new, put together where the file has them already."""

from __future__ import annotations

from datetime import UTC, datetime

import pytest

from ingest.bench.bench_file import read_bench
from ingest.errors import BenchFileError
from ingest.formats import utc_ns
from made import can_bench
from replay.engine.files.bench_text import corrected

SAYS = "By diagnosis d-4f0c.\nTaken off each reading."
AMBIENT = '[[channel]]\nsignal = "Room"\nquantity = "temperature"\nunit = "degC"\nnode = "ambient"\n'


def written(text: str, **corrections: float) -> str:
    return corrected(text.encode(), "bench.toml", _causes(corrections), SAYS).decode()


def _causes(amounts: dict[str, float]) -> dict[str, float]:
    """`sensor__magnet__bias` -> `sensor.magnet.bias`."""
    return {name.replace("__", "."): amount for name, amount in amounts.items()}


def amounts(text: str) -> dict[str, float]:
    return {one.cause: one.amount for one in read_bench(text.encode(), "bench.toml").corrections}


def test_new_corrections_stand_at_the_end_under_their_comment() -> None:
    text = written(can_bench.BENCH, sensor__magnet__bias=3.1000000001, clock__can1__offset=-2.0)
    assert text == can_bench.BENCH + (
        "\n# By diagnosis d-4f0c.\n# Taken off each reading.\n"
        '[[correction]]\ncause = "sensor.magnet.bias"\namount = 3.1\n\n'
        '[[correction]]\ncause = "clock.can1.offset"\namount = -2\n'
    )


def test_the_same_file_and_corrections_give_the_same_bytes() -> None:
    assert written(can_bench.BENCH, input__speed__gain=0.01) == written(can_bench.BENCH, input__speed__gain=0.01)


def test_amounts_of_additive_laws_are_summed_in_their_place() -> None:
    once = written(can_bench.BENCH, sensor__magnet__bias=3.0, sensor__winding__lag=4.0)
    once = once.replace("amount = 3\n", "amount = 3.0  # K\n")
    again = written(once, sensor__magnet__bias=-0.5, sensor__winding__lag=1.5, clock__can1__drift=100.0)
    assert amounts(again) == {"sensor.magnet.bias": 2.5, "sensor.winding.lag": 5.5, "clock.can1.drift": 100.0}
    assert "amount = 2.5  # K\n" in again
    assert again.index("amount = 2.5") < again.index("By diagnosis", again.index("amount = 2.5"))


def test_gains_are_multiplied_and_leads_leave_the_product() -> None:
    once = written(can_bench.BENCH + AMBIENT, input__current__gain=0.1, sensor__yoke__stem=0.1)
    again = amounts(written(once, input__current__gain=0.2, sensor__yoke__stem=0.2))
    assert again == pytest.approx({"input.current.gain": 0.32, "sensor.yoke.stem": 0.28})


def test_a_sensor_by_its_other_name_is_the_same_sensor() -> None:
    once = written(can_bench.BENCH, sensor__magnet__bias=3.0)
    assert amounts(written(once, **{"sensor__magnet@TC_magnet__bias": 1.0})) == {"sensor.magnet.bias": 4.0}


def test_below_an_exchange_the_same_name_is_another_sensor() -> None:
    once = written(can_bench.BENCH, sensor__magnet__bias=3.0, sensor__magnet__swap_yoke=1.0)
    again = read_bench(written(once, sensor__magnet__bias=1.0).encode(), "bench.toml").corrections
    assert [(one.cause, one.amount) for one in again] == [
        ("sensor.magnet.bias", 3.0),
        ("sensor.magnet.swap_yoke", 1.0),
        ("sensor.magnet.bias", 1.0),
    ]


def test_a_masked_fault_is_written_once() -> None:
    once = written(can_bench.BENCH, sensor__magnet__hold=1.0)
    assert amounts(written(once, sensor__magnet__hold=1.0)) == {"sensor.magnet.hold": 1.0}


def test_sensors_that_are_exchanged_already_are_not_exchanged_back() -> None:
    once = written(can_bench.BENCH, sensor__magnet__swap_yoke=1.0)
    line = once.splitlines().index('cause = "sensor.magnet.swap_yoke"') + 1
    with pytest.raises(BenchFileError, match=f"these two sensors are exchanged already, in line {line}: take that"):
        written(once, sensor__yoke__swap_magnet=1.0)


def test_a_cause_that_this_bench_cannot_have_is_refused_with_the_nearest() -> None:
    with pytest.raises(BenchFileError) as refused:
        written(can_bench.BENCH, sensor__magnt__bias=1.0)
    assert str(refused.value) == (
        'bench.toml: correction "sensor.magnt.bias" names a place that this bench does not have: no channel measures '
        '"magnt". Nearest: magnet.'
    )


def test_a_list_of_corrections_takes_new_amounts_and_is_refused_where_one_is_new() -> None:
    inline = 'correction = [{cause = "sensor.magnet.gain", amount = 0.1}, {cause = "sensor.yoke.bias", amount = 1.0}]\n'
    text = can_bench.BENCH.replace("specimen", inline + "specimen", 1)
    assert written(text, sensor__yoke__bias=2.0) == text.replace("amount = 1.0", "amount = 3")
    with pytest.raises(
        BenchFileError, match=r"cannot be added to: write each as a .+ table, cause and amount on a line"
    ):
        written(text, sensor__magnet__bias=2.0)


def test_a_file_from_another_editor_is_added_to_as_well() -> None:
    text = "\ufeff" + can_bench.BENCH.replace("\n", "\r\n").rstrip()
    assert amounts(written(text, sensor__magnet__bias=1.5)) == {"sensor.magnet.bias": 1.5}


def test_what_a_sensor_follows_stands_in_the_place_of_its_node() -> None:
    text = can_bench.BENCH.replace('node = "magnet"', 'node = "magnet"   # glued')
    shares = {"TC_magnet": {"magnet": 0.9, "yoke": 0.1}}
    found = corrected(text.encode(), "bench.toml", {"sensor.magnet.lag": 1.5}, SAYS, shares).decode()
    same = text.replace('node = "magnet"', "node = {magnet = 0.9, yoke = 0.1}")
    assert found.startswith(same)
    assert amounts(found) == {"sensor.magnet.lag": 1.5}
    again = corrected(
        found.encode(), "bench.toml", {}, SAYS, {"TC_magnet": {"magnet": 0.8, "yoke": 0.1, "winding": 0.1}}
    )
    assert again.decode() == found.replace("{magnet = 0.9, yoke = 0.1}", "{magnet = 0.8, yoke = 0.1, winding = 0.1}")


def test_shares_that_are_there_take_their_new_numbers() -> None:
    text = can_bench.BENCH.replace('node = "magnet"', "weights = {magnet = 0.9, yoke = 0.1}")
    found = corrected(text.encode(), "bench.toml", {}, SAYS, {"TC_magnet": {"magnet": 0.75, "yoke": 0.25}}).decode()
    assert found == text.replace("{magnet = 0.9, yoke = 0.1}", "{magnet = 0.75, yoke = 0.25}")


def test_a_correction_goes_on_speaking_of_its_sensor_when_that_follows_others_too() -> None:
    text = written(can_bench.BENCH, sensor__magnet__bias=3.0)
    found = corrected(
        text.encode(), "bench.toml", {"sensor.magnet.bias": 1.0}, SAYS, {"TC_magnet": {"magnet": 0.9, "yoke": 0.1}}
    )
    assert amounts(found.decode()) == {"sensor.magnet.bias": 4.0}


def test_shares_that_would_make_a_correction_speak_of_another_sensor_are_refused() -> None:
    other = (
        '[[channel]]\nsignal = "Room"\nquantity = "temperature"\nunit = "degC"\nweights = {magnet = 0.8, yoke = 0.2}\n'
    )
    text = written(can_bench.BENCH + other, sensor__magnet__bias=3.0)
    with pytest.raises(BenchFileError, match="call a sensor that shares its node node@signal"):
        corrected(text.encode(), "bench.toml", {}, SAYS, {"TC_magnet": {"magnet": 0.7, "yoke": 0.3}})


MOVED = '[[change]]\nfrom = 2025-02-11\nchannel = "TC_yoke"\nsensor = "TC-7"\n'
BEFORE, AFTER = (utc_ns(datetime(2025, month, 20, tzinfo=UTC)) for month in (1, 2))


@pytest.mark.parametrize(("at_ns", "date"), [(BEFORE, "until"), (AFTER, "from")])
def test_what_was_learnt_of_a_sensor_ends_where_another_takes_its_place(at_ns: int, date: str) -> None:
    text = can_bench.BENCH + MOVED
    once = corrected(text.encode(), "bench.toml", {"sensor.yoke.bias": 2.0}, SAYS, at_ns=at_ns)
    assert once.decode().endswith(
        f'[[correction]]\ncause = "sensor.yoke.bias"\namount = 2\n{date} = 2025-02-11T00:00:00Z\n'
    )
    again = corrected(once, "bench.toml", {"sensor.yoke.bias": 0.5}, SAYS, at_ns=at_ns)
    assert [one.amount for one in read_bench(again, "bench.toml").corrections] == [2.5]


def test_shares_of_a_sensor_that_a_change_concerns_are_not_written() -> None:
    text, shares = (can_bench.BENCH + MOVED).encode(), {"TC_yoke": {"yoke": 0.8, "winding": 0.2}}
    with pytest.raises(BenchFileError, match="what TC_yoke follows was learnt anew, and a change says other things"):
        corrected(text, "bench.toml", {}, SAYS, shares)
