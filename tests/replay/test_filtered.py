"""The filter beside a replay: on motors of another form with and without a hidden magnet loss, sealed, read back and drawn."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_runs import made_run

from ingest import facts
from ingest.catalogue.channels import load
from ingest.events import ReplayCompleted
from ingest.intake import take_in
from ingest.sessions import Override
from ingest.setup import prepare
from ingest.store import Store
from plant import Effect, Plant, drives, sessions, write_campaign
from replay.engine import runs
from replay.engine.artefacts import filtered_of, filtered_table
from replay.engine.campaign import replay_sessions
from replay.engine.filtered import filter_session, filtered_summary, mean_losses
from replay.engine.frame import InputFrame, Meter
from replay.engine.frame_of import session_frame
from replay.engine.identity import digest_of
from replay.engine.meters import Measurand
from replay.engine.models import for_intake, model_of
from replay.engine.motor_file import read_motor
from replay.engine.run import Filtered, Run
from replay.engine.sealed import load_run
from replay.show import layers
from replay.show.filter_plots import estimated_loss
from twin.network import Copper, Network
from twin.observables import Thermometric, copper_slope
from twin.simulate import Frame

SLOW_S, FAST_S = 400.0, 1200.0
SLOW_RPM, FAST_RPM = 2000.0, 9000.0
HIDDEN_W = 400.0  # at 16,000 rpm: 127 W at 9,000


@dataclass(frozen=True)
class Replayed:
    folder: Path
    event: ReplayCompleted
    run: Run
    network: Network
    frame: InputFrame


def replayed(folder: Path, *effects: Effect) -> Replayed:
    plant = Plant(5, effects)
    parts = [drives.hold(SLOW_RPM, 30.0, SLOW_S / 60), drives.hold(FAST_RPM, 40.0, FAST_S / 60)]
    drive = drives.join("s1", "s1", parts)
    logs = write_campaign(folder, plant, sessions(plant, [drive], layout="paper"), layout="paper")
    setup = prepare(logs, folder / "bench.toml", [folder / "bench.dbc"], for_intake)
    with Store.open(folder / "store", create=True) as store:
        take_in(store, logs, setup, Override())
        (session,) = facts.at(store.ledger).sessions
        (outcome,) = replay_sessions(store, [session], None, "testing", 1)
        assert outcome.run, outcome.refusal
        known = facts.at(store.ledger)
        network = read_motor(store.archive.read(outcome.run.model), "motor.toml")
        frame = session_frame(session, load(store, known, session), network)
        return Replayed(folder / "store", outcome.run, load_run(store, known, outcome.run), network, frame)


@pytest.fixture(scope="module")
def healthy(tmp_path_factory: pytest.TempPathFactory) -> Replayed:
    return replayed(tmp_path_factory.mktemp("healthy"))


@pytest.fixture(scope="module")
def hidden(tmp_path_factory: pytest.TempPathFactory) -> Replayed:
    return replayed(tmp_path_factory.mktemp("hidden"), Effect("loss.magnet.speed2", HIDDEN_W))


def losses(replayed: Replayed) -> dict[str, float]:
    inputs = Frame(replayed.frame.step_s, replayed.frame.features, replayed.frame.boundaries)
    return mean_losses(replayed.network, inputs, replayed.run.temperatures)


def filtered(run: Run) -> Filtered:
    assert run.filtered is not None
    return run.filtered


def test_the_estimated_heat_follows_a_hidden_one(healthy: Replayed, hidden: Replayed) -> None:
    """The same specimen with and without: what its motor file has wrong besides is in both. Its path from the magnets outwards
    is a third weaker than the real one, so less heat there explains the same temperatures."""
    steps = min(filtered(healthy.run).heat_W.size, filtered(hidden.run).heat_W.size)
    more = filtered(hidden.run).heat_W[:steps] - filtered(healthy.run).heat_W[:steps]
    slow, fast = (HIDDEN_W * (rpm / 16_000) ** 2 for rpm in (SLOW_RPM, FAST_RPM))
    assert more[: int(SLOW_S / 0.5)][-200:].mean() == pytest.approx(slow, abs=10.0)
    assert 0.4 * fast < more[-600:].mean() < 1.1 * fast


def test_the_kept_magnets_are_nearer_to_the_filter_than_to_the_open_loop(hidden: Replayed) -> None:
    entry = hidden.event.summary["filtered"]
    assert entry["node"] == "magnet"
    assert entry["measured"] == ["EW_A_inner", "EW_B_inner", "RS"]
    assert set(entry["mae_K"]) == {"MAG"}
    assert entry["mae_K"]["MAG"] < 0.5 * hidden.event.summary["mae_K"]["magnet"]
    assert entry["heat_bias_W"] == pytest.approx((filtered(hidden.run).heat_W - filtered(hidden.run).nominal_W).mean())
    assert 0.5 < entry["nis"] < 2.0


def test_the_filter_changes_nothing_in_the_open_loop(hidden: Replayed, monkeypatch: pytest.MonkeyPatch) -> None:
    run = hidden.run
    columns = [*run.temperatures.T, *(o.modelled for o in run.observed), *(o.residual for o in run.observed)]
    assert digest_of(columns) == hidden.event.digest
    monkeypatch.setattr(runs, "filter_session", lambda *_: None)
    with Store.open(hidden.folder) as store:
        known = facts.at(store.ledger)
        session = known.session(hidden.event.session)
        work = hidden.folder.parent
        without = runs.replay(store, known, session, model_of(known, session), "testing", "sdirk2", work)
    assert without.known
    assert (without.event.run, without.event.digest) == (hidden.event.run, hidden.event.digest)


def test_a_sealed_estimate_is_read_back_as_it_was(hidden: Replayed) -> None:
    found, sealed = filter_session(hidden.network, hidden.frame, losses(hidden), "testing"), filtered(hidden.run)
    assert found is not None
    for name in ("temperatures", "heat_W", "heat_sd_W", "nominal_W"):
        np.testing.assert_array_equal(getattr(found, name), getattr(sealed, name), err_msg=name)
    assert replace(found, **vars(sealed)) == sealed
    assert sealed.temperatures.shape == hidden.run.temperatures.shape
    assert sealed.heat_W.shape == (hidden.run.t_ns.size - 1,)
    assert found.smoothed is not None
    assert sealed.smoothed is not None
    for name in ("temperatures", "heat_W", "heat_sd_W"):
        np.testing.assert_array_equal(getattr(found.smoothed, name), getattr(sealed.smoothed, name), err_msg=name)


def test_the_smoother_knows_a_change_when_it_happens(hidden: Replayed) -> None:
    """The speed rises at 400 s, and the hidden loss with it: the filter still puts most of it later."""
    run = filtered(hidden.run)
    assert run.smoothed is not None
    extra = {"filter": run.heat_W - run.nominal_W, "smoother": run.smoothed.heat_W - run.nominal_W}
    before, after = slice(int((SLOW_S - 60) / 0.5), int((SLOW_S - 30) / 0.5)), slice(-600, None)
    at = {}
    for name, watts in extra.items():
        half = (watts[before].mean() + watts[after].mean()) / 2
        late = watts[int(SLOW_S / 0.5) - 60 :]
        at[name] = np.flatnonzero(np.convolve(late, np.ones(20) / 20, "valid") > half)[0] * 0.5 - 30
    assert at["smoother"] < at["filter"] - 5
    assert run.smoothed.heat_sd_W[200:-200].max() < run.heat_sd_W[200:-200].min()
    errors = hidden.event.summary["filtered"]
    assert errors["smoothed_mae_K"].keys() == errors["mae_K"].keys()
    assert errors["smoothed_mae_K"]["MAG"] < 1.1 * errors["mae_K"]["MAG"]


def test_an_estimate_that_was_sealed_without_a_smoother_still_loads(hidden: Replayed) -> None:
    run = filtered(hidden.run)
    table = filtered_table(hidden.frame, replace(run, smoothed=None), hidden.run.nodes)
    assert not any("smoothed" in column for column in table.column_names)
    entry = hidden.event.summary["filtered"]
    assert filtered_of(table, entry, hidden.run.nodes).smoothed is None
    plot: Any = estimated_loss(replace(hidden.run, filtered=replace(run, smoothed=None)), 600)
    assert "smoothed" not in plot.svg
    assert "lag" not in plot.note


def test_picture_table_and_layer_show_the_smoother(hidden: Replayed, tmp_path: Path) -> None:
    chunk = pytest.importorskip("rerun.chunk")
    plot: Any = estimated_loss(hidden.run, 600)
    assert "smoothed" in plot.svg
    assert "does not lag" in plot.note
    assert plot.table.head[-3:] == ("smoothed [W]", "standard deviation smoothed [W]", "smoothed [°C]")
    assert all(len(row) == len(plot.table.head) for row in plot.table.rows)
    layers.write_filtered(hidden.run, tmp_path / "filtered.rrd")
    batches = [batch.to_record_batch() for batch in chunk.RrdReader(tmp_path / "filtered.rrd").stream()]
    paths = {batch.schema.metadata[b"rerun:entity_path"].decode().split("/", 3)[-1] for batch in batches}
    assert {"magnet/smoothed", "magnet/smoothed_from", "magnet/smoothed_to"} <= {p for p in paths if "magnet" in p}


def test_a_run_that_was_sealed_without_a_filter_still_loads(hidden: Replayed) -> None:
    artefacts = {name: sha for name, sha in hidden.event.artefacts.items() if name != "filtered"}
    summary = {name: value for name, value in hidden.event.summary.items() if name != "filtered"}
    with Store.open(hidden.folder) as store:
        run = load_run(store, facts.at(store.ledger), replace(hidden.event, artefacts=artefacts, summary=summary))
    assert run.filtered is None
    assert estimated_loss(run, 600) is None


def as_resistance(frame: InputFrame, channel: str, gain: float, referenced: bool) -> InputFrame:
    """The frame with a channel in the place of a winding resistance of 15 mOhm at 20 degC, which its meter reads too high by `gain`."""
    (o,) = (o for o in frame.observations if o.channel == channel)
    law = Thermometric(o.weights, 0.015, copper_slope(Copper(), 20.0), 20.0)
    seen = replace(
        o, measured=(1 + gain) * law.reading(o.measured), noise=o.noise * law.per_K, resolution=0.0, bias_sd=0.0
    )
    meter = Meter(Measurand("resistance", 0.01, law=law, referenced=referenced), seen)
    rest = tuple(o for o in frame.observations if o.channel != channel)
    return replace(frame, observations=rest, meters=(meter,))


@pytest.mark.parametrize(("gain", "referenced"), [(0.0, True), (0.01, True), (0.01, False)])
def test_a_winding_resistance_is_read_as_the_temperature_that_it_stands_for(
    hidden: Replayed, gain: float, referenced: bool
) -> None:
    frame = as_resistance(hidden.frame, "EW_A_inner", gain, referenced)
    found = filter_session(hidden.network, frame, losses(hidden), "testing")
    assert found is not None
    assert found.measured == ("EW_B_inner", "RS", "EW_A_inner")
    as_read = filtered(hidden.run)
    apart = np.abs(found.temperatures - as_read.temperatures)[600:]
    winding, magnet = (hidden.run.nodes.index(name) for name in ("endwinding_a_inner", "magnet"))
    assert apart[:, magnet].mean() < 0.5
    assert apart[:, winding].mean() < 4.0, "1 % of a resistance is 3 K"
    summary = filtered_summary(found, frame, hidden.run.nodes)
    assert set(summary["mae_K"]) == {"MAG"}


def test_node_and_channels_can_be_said(hidden: Replayed) -> None:
    found = filter_session(hidden.network, hidden.frame, losses(hidden), "testing", "rotor_surface", ["RS", "MAG"])
    assert found is not None
    assert (found.node, found.measured) == ("rotor_surface", ("RS", "MAG"))


def test_without_a_channel_to_see_there_is_no_filter(hidden: Replayed) -> None:
    assert filter_session(hidden.network, hidden.frame, losses(hidden), "production") is None
    assert filter_session(hidden.network, hidden.frame, losses(hidden), "testing", measured=[]) is None


@pytest.mark.parametrize(
    ("regions", "expected"),
    [
        ({"magnet": "magnet", "yoke": "magnet"}, "yoke"),
        ({"magnet": "rotor"}, "rotor_surface"),
        ({"magnet": "other", "rotor_surface": "other", "rotor_core": "other", "shaft": "other"}, None),
    ],
)
def test_the_heat_is_put_at_the_hottest_source_of_magnets_else_of_the_rotor(
    hidden: Replayed, regions: dict[str, str], expected: str | None
) -> None:
    nodes = tuple(
        replace(node, region=regions.get(node.name, "other" if expected is None else node.region))
        for node in hidden.network.nodes
    )
    found = filter_session(replace(hidden.network, nodes=nodes), hidden.frame, losses(hidden), "testing")
    assert (found.node if found else None) == expected


def with_filter(extra_W: float, sd_W: float = 5.0) -> Run:
    run = made_run()
    heat = np.full(run.t_ns.size - 1, 14.0)
    made = Filtered(
        node="rotor_surface",
        measured=("T_1", "T_2"),
        temperatures=run.temperatures + 0.5,
        heat_W=heat + extra_W,
        heat_sd_W=np.full(heat.size, sd_W),
        nominal_W=heat,
        heat_walk_W=0.4,
        nis=1.1,
    )
    return replace(run, filtered=made)


@pytest.mark.parametrize(
    ("extra", "cause", "title"),
    [
        (26.0, None, "The filter puts 26 W more loss at the rotor surface than the modelled 14 W, ± 10 W at any time"),
        (
            4.0,
            None,
            "The filter sees no other loss at the rotor surface: 4 W more than the modelled 14 W, ± 10 W at any time",
        ),
        (
            26.0,
            "a weaker shrink fit",
            "Not the rotor surface: the filter puts 26 W more there than the modelled 14 W, "
            + "± 10 W at any time, yet the evidence names a weaker shrink fit",
        ),
    ],
)
def test_the_plot_says_what_the_filter_found(extra: float, cause: str | None, title: str) -> None:
    plot: Any = estimated_loss(with_filter(extra), 600, cause)
    assert plot.title == title
    assert "no evidence that the cause is there" in plot.note
    assert "T_3, kept" in plot.svg
    assert "estimated" in plot.svg
    assert plot.table.head[1:4] == ("estimated [W]", "standard deviation [W]", "modelled [W]")
    assert plot.table.rows[0][1:4] == (f"{14 + extra:.1f}", "5.0", "14.0")
