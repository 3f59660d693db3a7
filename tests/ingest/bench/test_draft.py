"""A draft bench file reads back and fits the very logs that it was drafted for."""

from __future__ import annotations

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ingest.bench.bench_file import read_bench
from ingest.bench.draft import draft_bench
from ingest.bench.resolving import resolve
from ingest.bench.signals import Signal

UNITS = st.sampled_from(
    [None, "", "°C", "K", "degF", "A", "Apk", "Vrms", "U/min", "Nm", "kW", "l/min", "bar", "-", "MΩ", "??"]
)
NAMES = st.one_of(
    st.sampled_from(
        ["Speed", "IdFbk", "T_EndWinding.A", "1st temp", "ambient", "TrqSoll", 'quo"te\\n', "Температура", "MAG_1"]
    ),
    st.text(min_size=1, max_size=12),
)
BUSES = st.sampled_from([None, "can1", "can2"])
FRAMES = st.builds(Signal, NAMES, st.sampled_from(["TempA", "Motor"]), BUSES, UNITS, st.sampled_from([None, 0.1]))
TABLES = st.builds(Signal, NAMES, unit=UNITS)


@given(st.one_of(st.lists(FRAMES, max_size=8), st.lists(TABLES, max_size=8, unique_by=lambda signal: signal.name)))
def test_a_draft_is_a_bench_file_that_fits_its_logs(signals: list[Signal]) -> None:
    text = draft_bench(signals, {}, "logs")
    bench = read_bench(text.encode("utf-8"), "draft.toml")
    assert len(resolve(bench, signals)) == text.count("\n[[channel]]\n") + text.count("\n[[derived]]")


TABLE = [
    Signal("Zeit"),
    Signal("T_Wicklung_1", unit="°C"),
    Signal("ambient", unit="degC"),
    Signal("TC_coolant", unit="degC"),
    Signal("Drehzahl", unit="U/min"),
    Signal("n2", unit="rpm"),
    Signal("Id", unit="Apk"),
    Signal("Torque"),
]


def test_a_draft_guesses_quantity_unit_and_node() -> None:
    text = draft_bench(TABLE, {}, "a.csv")
    channels = {channel.name: channel for channel in resolve(read_bench(text.encode(), "draft.toml"), TABLE)}
    assert {name: (c.quantity, c.unit, c.node, c.role) for name, c in channels.items()} == {
        "Drehzahl": ("speed", "U/min", None, "input"),
        "n2": ("speed", "rpm", None, "input"),
        "Id": ("current_d", "Apk", None, "input"),
        "Torque": ("torque", "Nm", None, "input"),
        "T_Wicklung_1": ("temperature", "°C", "winding_1", "observed"),
        "ambient": ("temperature", "degC", "ambient", "input"),
        "TC_coolant": ("temperature", "degC", "coolant", "input"),
    }


def test_names_without_a_plain_letter_are_places_of_their_own() -> None:
    """And the one name of two messages is one place."""
    names = ("コイル温度", "外気温", "CH 水温", "CH 油温", "T_Wicklung")
    signals = [Signal(name, unit="degC") for name in names]
    text = draft_bench([*signals, Signal("コイル温度", message="b", unit="degC")], {}, "a.csv")
    nodes = re.findall(r'^node = "(.*)"', text, re.MULTILINE)
    assert nodes == ["node_1", "node_2", "ch_1", "ch_2", "winding", "node_1"]


def test_the_current_of_losses_is_drafted_from_its_parts_where_nothing_records_it() -> None:
    parts = [Signal("i_d", unit="Apk"), Signal("i q", unit="Apk")]
    (*_, current) = resolve(read_bench(draft_bench(parts, {}, "a.csv").encode(), "draft.toml"), parts)
    assert current.derived
    assert (current.name, current.quantity, current.unit) == ("current", "current", "Apk")
    assert current.conversion.scale == pytest.approx(0.5**0.5)
    assert 'expression = "hypot(i_d, `i q`)"' in draft_bench(parts, {}, "a.csv")
    for more in (Signal("I_rms", unit="A"), Signal("id_2", unit="A"), Signal("current")):
        assert "[[derived]]" not in draft_bench([*parts, more], {}, "a.csv")
    assert "[[derived]]" not in draft_bench([parts[0], Signal("iq", unit="kA")], {}, "a.csv")


@pytest.mark.parametrize(
    "line",
    [
        'quantity = "speed"  # CHECK: several signals look like speed; keep one',
        'unit = "Nm"  # CHECK: the log does not say',
        "#   Zeit",
    ],
)
def test_a_draft_says_where_a_person_must_decide(line: str) -> None:
    assert line in draft_bench(TABLE, {}, "a.csv").split("\n")


def test_a_unit_that_is_not_known_is_asked_for_in_the_words_of_the_log() -> None:
    text = draft_bench([Signal("Torque", unit="stone foot")], {}, "a.csv")
    assert 'unit = "Nm"  # CHECK: the log says stone foot, which is not known\n' in text


def test_a_table_without_a_time_column_gets_a_rate_to_fill_in() -> None:
    without = draft_bench([Signal("speed")], {"untimed": "no column is its time."}, "a.csv")
    assert "# no column is its time.\n[time]\nrate_hz = 1.0                  # CHECK" in without
    assert read_bench(without.encode(), "draft.toml").time.rate_hz == 1.0
    assert "[time]" not in draft_bench([Signal("speed")], {"untimed": None}, "a.csv")


def test_a_draft_of_dated_logs_says_where_their_zone_stands() -> None:
    text = draft_bench([Signal("speed")], {"absolute": True}, "a.csv")
    assert '# [time]\n# zone = "Europe/Berlin"\n' in text
    both = draft_bench([Signal("speed")], {"absolute": True, "untimed": "none.", "format": "xlsx"}, "2 logs")
    assert read_bench(both.encode(), "draft.toml").time_of["xlsx"].rate_hz == 1.0


def test_equal_names_are_written_with_message_or_bus() -> None:
    signals = [Signal("T", "A", "can1", "°C"), Signal("T", "A", "can2", "°C"), Signal("T", "B", "can1", "°C")]
    text = draft_bench(signals, {}, "a.blf")
    assert [line for line in text.split("\n") if line.startswith("signal")] == [
        'signal = "can1:A.T"',
        'signal = "can2:A.T"',
        'signal = "B.T"',
    ]


def test_a_name_of_a_log_cannot_leave_its_comment() -> None:
    text = draft_bench([Signal("Remark\n[[channel]]")], {}, "evil\nmotor = 3.csv")
    assert "# Draft for evil?motor = 3.csv:" in text and read_bench(text.encode(), "draft.toml").channels == ()


@pytest.mark.parametrize(
    ("name", "node"),
    [
        ("T_Rücken", "ruecken"),
        ("T_Ru\u0308cken", "ruecken"),
        ("T_Kühlwasser_ein", "coolant_ein"),
        ("T_cool_in", "coolant_in"),
        ("Twdg_A", "twdg_a"),
        ("T_wdg_A", "winding_a"),
        ("T_mag", "magnet"),
        ("Umgebung", "ambient"),
        ("T avvolgimento 2", "winding_2"),
        ("Gehäuse", "housing"),
        ("Étuve 1", "oven_1"),
        ("Bobinage_U", "winding_u"),
        ("Température ambiante", "ambient"),
        ("Temperatur Wicklung", "winding"),
        ("Palier AR", "bearing_ar"),
        ("Imán", "magnet"),
        ("101 <Wicklung> (C)", "winding_101"),
    ],
)
def test_a_drafted_node_keeps_umlauts_and_knows_what_places_are_called(name: str, node: str) -> None:
    assert f'node = "{node}"\n' in draft_bench([Signal(name, unit="°C")], {}, "a.csv")


@pytest.mark.parametrize(("beside", "node"), [("T_three", "four"), ("T_ambiante", "oven"), ("T_one", "four")])
def test_four_is_a_number_among_numbers_and_an_oven_elsewhere(beside: str, node: str) -> None:
    assert f'node = "{node}"\n' in draft_bench([Signal(beside, unit="°C"), Signal("T_four", unit="°C")], {}, "a.csv")


@pytest.mark.parametrize(
    "name",
    [
        "Aimant",
        "Palier",
        "Kühl_ein",
        "T_mag",
        "wdg_2",
        "cool_out",
        "Rücklauf",
        "Joch",
        "dente_3",
        "Étuve",
        "Bobinage 2",
        "Culasse",
    ],
)
def test_a_place_without_a_unit_is_a_temperature(name: str) -> None:
    assert 'quantity = "temperature"' in draft_bench([Signal(name)], {}, "a.csv")


def test_signals_of_loggers_that_do_not_run_at_once_are_no_rivals() -> None:
    ours, theirs = Signal("n_mot", unit="rpm"), Signal("Drehzahl", unit="U/min")
    assert "keep one" in draft_bench([ours, theirs], {}, "logs")
    assert "keep one" in draft_bench([ours, theirs], {}, "logs", [[ours, theirs]])
    assert "keep one" not in draft_bench([ours, theirs], {}, "logs", [[ours], [theirs]])
