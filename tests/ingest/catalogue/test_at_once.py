"""Which log counts where several hold a channel at the same time."""

from __future__ import annotations

import io
from pathlib import Path

import can
import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from analytics import warehouse
from ingest.catalogue.at_once import counted, goes_on
from ingest.catalogue.channels import load
from ingest.catalogue.operating_points import cells, draw
from ingest.catalogue.power import balance
from ingest.facts.facts import at
from ingest.facts.sessions import Override
from ingest.facts.store import Store
from ingest.intake.intake import take_in
from ingest.intake.setup import prepare

EXAMPLE = Path(__file__).parents[3] / "examples" / "hidden_effect"


def _ns(t_s: ArrayLike) -> NDArray[np.int64]:
    return np.round(np.asarray(t_s, np.float64) * 1e9).astype(np.int64)


def _counted(*logs: ArrayLike) -> list[list[float]]:
    """The stamps [s] of each log that count, of logs with the same values."""
    t_ns = np.concatenate([_ns(log) for log in logs])
    log = np.repeat(np.arange(len(logs)), [np.size(one) for one in logs])
    order = np.argsort(t_ns, kind="stable")
    kept = order[counted(t_ns[order], np.zeros(len(order)), log[order])]
    return [sorted((t_ns[kept[log[kept] == one]] / 1e9).tolist()) for one in range(len(logs))]


def test_of_one_log_in_two_formats_the_first_counts() -> None:
    t_s = np.arange(100) * 0.1
    first, second = _counted(t_s, t_s + np.where(np.arange(100) < 99, 4e-7, 0.0))
    assert (len(first), second) == (100, [])


def test_of_two_loggers_that_run_as_long_the_one_with_less_time_between_its_samples_counts() -> None:
    coarse, fine = _counted(np.arange(0, 60, 5.0), np.arange(3, 59, 0.5))
    assert (coarse, len(fine)) == ([0.0], 112)


def test_a_burst_of_a_fast_recorder_makes_no_gaps_of_the_others_time() -> None:
    log, burst = _counted(np.arange(3600.0), 1800 + np.arange(10_000) * 1e-3)
    assert (len(log), burst) == (3600, [])


def test_the_other_logger_fills_a_gap() -> None:
    first, second = _counted([*range(20), *range(40, 60)], np.arange(60) + 0.3)
    assert len(first) == 40
    assert second == [t + 0.3 for t in [*range(19, 40), 59]]


def test_logs_that_follow_each_other_count_both_and_what_both_hold_at_the_seam_once() -> None:
    assert [len(one) for one in _counted(np.arange(10.0), np.arange(10, 20.0))] == [10, 10]
    first, second = _counted(np.arange(10.0), np.arange(8, 18.0))
    assert (first, second) == (list(range(10)), list(range(10, 18)))


def test_of_what_was_measured_one_by_one_all_counts_but_copies() -> None:
    hourly = np.arange(10) * 3600.0
    assert [len(one) for one in _counted(hourly, hourly + 1800)] == [10, 10]
    assert [len(one) for one in _counted(hourly, hourly[3:7])] == [10, 0]
    assert counted(_ns([0, 0]), np.array([1.0, 2.0]), np.array([0, 1])).all()


def test_of_a_thousand_logs_that_overlap_each_stretch_counts_once() -> None:
    logs = [np.arange(i * 10, i * 10 + 12) * 1.0 for i in range(1000)]
    kept = _counted(*logs)
    assert sorted(t for one in kept for t in one) == list(range(10_002))


def test_a_log_goes_on_between_its_samples_and_at_its_ends() -> None:
    assert goes_on(_ns([0, 1, 2, 3, 20]), _ns([-1, 0, 2.5, 3, 10, 20, 21])).tolist() == [
        False, True, True, True, False, True, False
    ]  # fmt: skip
    assert goes_on(_ns([4]), _ns([3, 4, 5])).tolist() == [False, True, False]


@pytest.fixture(scope="module")
def in_two_formats(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An S1 of the example as BLF and as ASC, which has stamps in microseconds, in one store; the BLF in another."""
    folder = tmp_path_factory.mktemp("formats")
    text = io.StringIO()
    writer = can.ASCWriter(text)
    with can.LogReader(EXAMPLE / "4_s1.blf") as reader:
        for message in reader:
            writer.on_message_received(message)
    (folder / "4_s1.asc").write_text(text.getvalue(), encoding="utf-8")
    bench = (EXAMPLE / "bench.toml").read_text(encoding="utf-8").replace('motor = "motor.toml"\n', "")
    (folder / "bench.toml").write_text(bench, encoding="utf-8")
    for name, logs in (("both", [EXAMPLE / "4_s1.blf", folder / "4_s1.asc"]), ("one", [EXAMPLE / "4_s1.blf"])):
        with Store.open(folder / name, create=True) as store:
            setup = prepare(logs, folder / "bench.toml", [EXAMPLE / "bench.dbc"], lambda path: pytest.fail(str(path)))
            take_in(store, logs, setup, Override())
    return folder


def test_a_log_in_two_formats_says_what_it_says_alone(in_two_formats: Path) -> None:
    said, asked = [], []
    for name in ("both", "one"):
        with Store.open(in_two_formats / name) as store:
            facts = at(store.ledger)
            channels = load(store, facts, facts.sessions[0])
            points, power = cells(channels), balance(channels)
            assert points and power
            said.append((draw(points), power.says))
            with warehouse.refresh(store) as opened:
                one = opened.connection.execute(
                    "SELECT channel, round(hours_above, 5) FROM equivalent_hours_of('4_s1', 100, 150, 1.0) ORDER BY 1"
                ).fetchall()
                left = opened.connection.execute("SELECT count(*) FROM samples WHERE NOT doubled").fetchall()[0][0]
            asked.append(one)
            # either may have one sample more at either end, where a file ends a microsecond before the other
            assert abs(left - sum(len(channel.t_ns) for channel in channels)) <= len(channels)
    assert asked[0] == asked[1] and len(asked[0]) >= 4
    assert said[0] == said[1]
