"""Order of a specimen's sessions, and what each of its checks had behind it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ingest.facts.events import SessionRecorded
from replay.engine.specimen.heat_history import Trace, doses, in_order


def session(name: str, kind: str, start_ns: int | None = None) -> SessionRecorded:
    return SessionRecorded(
        session=f"{name}-id",
        name=name,
        kind=kind,
        kind_why="",
        specimen="S01",
        batch=None,
        bench=None,
        configuration=None,
        attributes={},
        absolute=start_ns is not None,
        start_ns=start_ns or 0,
        end_ns=(start_ns or 0) + 1,
        files=[],
    )


def names(sessions: list[SessionRecorded]) -> list[str]:
    return [one.name for one in sessions]


def test_stamps_tell_the_order_whatever_the_names_say() -> None:
    given = [session("dc_1", "dc_check", 30), session("oven_2", "ageing", 20), session("oven_1", "ageing", 10)]
    ordered, by_time = in_order(given)
    assert names(ordered) == ["oven_1", "oven_2", "dc_1"]
    assert by_time


def test_without_stamps_a_check_follows_the_oven_of_its_number() -> None:
    given = [session(f"{what}_{k}", kind) for what, kind in (("dc", "dc_check"), ("oven", "ageing")) for k in (10, 9)]
    ordered, by_time = in_order(given)
    assert names(ordered) == ["oven_9", "dc_9", "oven_10", "dc_10"]
    assert not by_time


@pytest.mark.parametrize("first", [0, 1])
def test_without_stamps_a_check_more_than_ovens_is_the_start(first: int) -> None:
    checks = [session(f"dc_{k}", "dc_check") for k in range(first, first + 3)]
    ovens = [session(f"oven_{k}", "ageing") for k in (1, 2)]
    ordered, _ = in_order([*ovens, *checks])
    assert [one.kind for one in ordered] == ["dc_check", "ageing", "dc_check", "ageing", "dc_check"]


def hours(one: Trace) -> np.ndarray:
    return np.array([one.heat.hours.sum()])


def steady(start_ns: int, duration_h: int, degC: float) -> Trace:
    """A sample a minute."""
    minutes = np.arange(60 * duration_h + 1, dtype=np.int64)
    return Trace(start_ns + minutes * 60_000_000_000, np.full(len(minutes), degC), "W")


HOUR_NS = 3_600_000_000_000


def test_a_check_has_behind_it_what_the_sessions_before_it_add_up_to() -> None:
    given = [session(name, kind, k) for k, (name, kind) in enumerate(zip("abcd", KINDS, strict=True), 1)]
    traces = {"b-id": steady(2, 12, 230.0), "c-id": steady(3, 1, 190.0), "d-id": steady(4, 1, 100.0)}
    found = doses(given, False, traces, hours, np.zeros(1))
    assert {name: None if dose is None else dose.tolist() for name, dose in found.items()} == {
        "a-id": [0.0],
        "b-id": [0.0],
        "c-id": [pytest.approx(12.0)],
        "d-id": [pytest.approx(13.0)],
    }


KINDS = ("dc_check", "ageing", "wltp", "dc_check")


def test_an_oven_log_that_goes_on_counts_up_to_each_check() -> None:
    oven = replace(session("oven", "ageing", 1), end_ns=20 * HOUR_NS)
    checks = [session(f"dc_{k}", "dc_check", k * HOUR_NS) for k in (5, 15)]
    found = doses([oven, *checks], True, {"oven-id": steady(1, 20, 230.0)}, hours, np.zeros(1))
    assert [found[f"dc_{k}-id"] for k in (5, 15)] == [pytest.approx(5.0, abs=0.02), pytest.approx(15.0, abs=0.02)]


def test_hours_above_a_temperature_go_to_the_crossing_and_not_through_a_gap() -> None:
    minutes = np.array([*range(61), *range(300, 361)], dtype=np.int64)
    degC = np.where(minutes < 61, 150.0 + minutes, 190.0)
    trace = Trace(minutes * 60_000_000_000, degC, "W")
    assert trace.hours_above(180.0) == pytest.approx(0.5 + 1.0)
    assert trace.until(50 * 60_000_000_000).hours_above(180.0) == pytest.approx(19 / 60)
    assert trace.until(0).hours_above(180.0) == 0.0
    assert trace.until(0).heat.hours.size == 0


def test_behind_an_oven_without_temperatures_no_dose_is_known() -> None:
    given = [session("a", "dc_check", 1), session("b", "ageing", 2), session("c", "dc_check", 3)]
    found = doses(given, True, {"b-id": None}, hours, np.zeros(1))
    assert found["a-id"] is not None
    assert found["c-id"] is None
