"""Where a node's error went: the steps add up, and both ends are what the gain says."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import pytest

from made.diagnoses import ABSORBED, BIAS, EDDY, NAMED, SEVERAL, SILENT, gain, runs, session_id
from replay.engine.results.run import Run
from replay.show.reports.kept_errors import errors
from replay.show.reports.waterfall_plot import waterfall
from replay.show.words.figure import Plot
from replay.studies.diagnosis.answer import Diagnosis

Runs = Mapping[str, Mapping[str, Run]]


def drawn(diagnosis: Diagnosis, of: Runs | None = None) -> Plot:
    plot = waterfall(diagnosis, of or {})
    assert plot is not None
    return plot


def corrected(by_K: float) -> Runs:
    """Runs of the kept sessions in which the bench file makes the rotor's error smaller by so much."""
    found = runs("extended", names=("4_s1", "5_wltp"), steps=60)
    for session, models in found.items():
        run = models["extended"]
        channels = [
            replace(c, mae_recorded_K=c.mae_K + by_K, reading_moved_K=by_K) if c.node == "rotor_surface" else c
            for c in run.summary.channels
        ]
        found[session] = {"extended": replace(run, summary=replace(run.summary, channels=channels))}
    return found


@pytest.mark.parametrize("diagnosis", [NAMED, SEVERAL, ABSORBED], ids=["one", "several", "none"])
@pytest.mark.parametrize("by_K", [0.0, 0.44])
def test_the_figures_of_every_node_add_up_to_what_is_left(diagnosis: Diagnosis, by_K: float) -> None:
    for _, *cells in drawn(diagnosis, corrected(by_K) if by_K else None).table.rows:
        published, *steps, left = [float(cell.replace("−", "-")) for cell in cells]
        assert published + sum(steps) == pytest.approx(left, abs=1e-9)


def test_the_ends_are_those_of_the_gain() -> None:
    plot = drawn(NAMED)
    told = {row[0]: row for row in plot.table.rows}
    for one in NAMED.gain:
        _, published, *_, left = told[one.node.replace("_", " ")]
        assert errors(one, ["published", "after"]).startswith(f"{published} -> {left} K")
    assert plot.title == (
        "Magnet: 10.1 K off as published, coefficients −3.7 K, loss.magnet.speed2_current2 −4.1 K: 2.3 K left"
    )
    assert plot.table.head == (
        "node",
        "as published [K]",
        "coefficients [K]",
        "+ loss.magnet.speed2_current2 [K]",
        "what is left [K]",
    )


def test_each_cause_has_its_step_where_every_node_was_replayed_with_it() -> None:
    kept = [gain("magnet", 3.0, 0.5, (1.0, 2.0), 6.0, recorded=(5.0, 3.4, 0.8)), NAMED.gain[0]]
    assert drawn(replace(SEVERAL, gain=kept[:1])).table.rows == (("magnet", "5.0", "−1.6", "−2.2", "−0.4", "0.8"),)
    together = drawn(replace(SEVERAL, gain=kept, causes=[EDDY, BIAS]))
    assert together.table.head[3] == "+ 2 causes [K]"


def test_readings_corrections_are_a_step_of_their_own_where_they_matter() -> None:
    plot = drawn(NAMED, corrected(0.44))
    (rotor,) = (row for row in plot.table.rows if row[0] == "rotor surface")
    assert rotor[-2:] == ("−0.4", "0.6")
    assert "Readings' corrections change no temperature of the model" in plot.note
    assert "readings' corrections [K]" not in drawn(NAMED, corrected(0.01)).table.head


def test_without_files_that_were_replayed_there_is_nothing_to_draw() -> None:
    assert waterfall(SILENT, {session_id("4_s1"): {}}) is None
    assert waterfall(replace(NAMED, gain=[]), {}) is None
