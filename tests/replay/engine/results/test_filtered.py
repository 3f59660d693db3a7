"""The filter beside a replay: on motors of another form with and without a hidden magnet loss, sealed, read back and
drawn."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ingest.catalogue.channels import load
from ingest.facts import facts
from ingest.facts.events import ReplayCompleted
from ingest.facts.sessions import Override
from ingest.facts.store import Store
from ingest.intake.intake import take_in
from ingest.intake.setup import prepare
from made.runs import made_run
from made.seen import seen_session
from plant import Effect, Plant, drives, sessions, write_campaign
from replay.engine.files.models import for_intake, model_of
from replay.engine.files.motor_file import read_motor
from replay.engine.frame.frame import InputFrame
from replay.engine.frame.frame_of import session_frame
from replay.engine.frame.observations import Meter
from replay.engine.results.artefacts import filtered_of, filtered_table
from replay.engine.results.asked_unknowns import asked_unknowns
from replay.engine.results.filtered import filter_session, filter_summary, mean_losses
from replay.engine.results.heat_readings import WANDERS_S, heat_readings
from replay.engine.results.kernel_cache import load_kernel
from replay.engine.results.open_loop import initial_temperatures, modelled
from replay.engine.results.run import Filtered, Run
from replay.engine.results.sealed import load_run
from replay.engine.runs import runs
from replay.engine.runs.campaign import replay_sessions
from replay.engine.runs.identity import digest_of
from replay.show.plots.filter_plots import courses, estimated_loss, filter_over_time
from replay.show.reports.report import ReportContext, write_report
from replay.show.viewer.layers import write_layers
from replay.show.viewer.seen import SessionSeen
from replay.show.words.filter_words import checked
from twin.filters.unknowns import Unknown
from twin.motor.network import Copper, Network
from twin.motor.observables import Measurand, Thermometric, copper_slope
from twin.motor.sensor import Sensor
from twin.motor.slicing import sliced
from twin.run.losses import HeatFlows, heat_flows
from twin.run.simulate import Frame, simulate

Floats = NDArray[np.float64]

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
    plant = Plant(5, *effects)
    parts = [drives.hold(SLOW_RPM, 30.0, SLOW_S / 60), drives.hold(FAST_RPM, 40.0, FAST_S / 60)]
    drive = drives.join("s1", "s1", parts)
    logs = write_campaign(folder, plant, sessions(plant, [drive], layout="paper"), layout="paper")
    setup = prepare(logs, folder / "bench.toml", [folder / "bench.dbc"], for_intake)
    with Store.open(folder / "store", create=True) as store:
        take_in(store, logs, setup, Override())
        (session,) = facts.at(store.ledger).sessions
        (outcome,) = replay_sessions(store, [session], None, "testing")
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
    """The same specimen with and without: what its motor file has wrong besides is in both. Its path from the magnets
    outwards is a third weaker than the real one, so less heat there explains the same temperatures."""
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


def test_filterpys_filter_beside_it_agrees_to_rounding_and_that_is_said(hidden: Replayed) -> None:
    with Store.open(hidden.folder, write=True) as store:
        session = facts.at(store.ledger).session(hidden.event.session)
        (done,) = replay_sessions(store, [session], None, "testing", check_filter=True)
        (plain,) = replay_sessions(store, [session], None, "testing")
    assert plain.apart is None
    assert done.apart is not None
    assert done.apart.temperature_K < 1e-9
    assert done.apart.sd_K < 1e-9
    assert done.run is not None
    assert done.run.digest == hidden.event.digest
    assert checked({"a": done.apart}).startswith("filterpy's filter is at most ")
    wrong = checked({"a": replace(done.apart, sd_K=0.1), "b": done.apart, "c": None})
    assert wrong.endswith(
        "(furthest in a, of 2 sessions); that is no rounding: report it with whyhot doctor; no filter ran over c"
    )


def test_a_sealed_estimate_is_read_back_as_it_was(hidden: Replayed) -> None:
    found, sealed = filter_session(hidden.network, hidden.frame, losses(hidden), "testing"), filtered(hidden.run)
    assert found is not None
    for name in ("temperatures", "heat_W", "heat_sd_W", "nominal_W"):
        np.testing.assert_array_equal(getattr(found, name), getattr(sealed, name), err_msg=name)
    for name in ("node", "measured", "heat_walk_W", "nis"):
        assert getattr(found, name) == getattr(sealed, name)
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
    assert hidden.run.summary.filtered is not None
    assert filtered_of(table, hidden.run.summary.filtered, hidden.run.nodes).smoothed is None
    plot: Any = estimated_loss(replace(hidden.run, filtered=replace(run, smoothed=None)), 600)
    assert "smoothed" not in plot.svg


def test_picture_table_and_layer_show_the_smoother(hidden: Replayed, tmp_path: Path) -> None:
    chunk = pytest.importorskip("rerun.chunk")
    plot: Any = estimated_loss(hidden.run, 600)
    assert "smoothed" in plot.svg
    assert plot.table.head[-3:] == ("smoothed [W]", "standard deviation smoothed [W]", "smoothed [°C]")
    assert all(len(row) == len(plot.table.head) for row in plot.table.rows)
    files = write_layers(SessionSeen(seen_session(), [], {"published": hidden.run}), tmp_path)
    layer = next(file for file in files if file.name.endswith(".filtered.rrd"))
    batches = [batch.to_record_batch() for batch in chunk.RrdReader(layer).stream()]
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
    """The frame with a channel in the place of a winding resistance of 15 mOhm at 20 degC, which its meter reads too
    high by `gain`."""
    (o,) = (o for o in frame.observations if o.sensor.name == channel)
    law = Thermometric(0.015, copper_slope(Copper(), 20.0), 20.0)
    sensor = replace(o.sensor, noise=o.sensor.noise * law.per_K, resolution=0.0, bias_sd=0.0)
    seen = replace(o, sensor=sensor, measured=(1 + gain) * law.reading(o.measured))
    meter = Meter(Measurand("resistance", "ohm", 0.01, law=law, referenced=referenced), seen)
    rest = tuple(o for o in frame.observations if o.sensor.name != channel)
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
    summary = filter_summary(found, frame, hidden.run.nodes)
    assert set(summary.mae_K) == {"MAG"}


def test_slices_of_a_magnet_share_one_unknown(hidden: Replayed) -> None:
    """The sensor at the rotor's surface lies at one end; the kept magnet in the middle is nearer all the same."""
    cut = sliced(hidden.network, ["rotor_surface", "magnet", "rotor_core"], 3, 0.134)
    frame = replace(
        hidden.frame,
        observations=tuple(
            replace(o, sensor=replace(o.sensor, weights={"rotor_surface_1": 1.0})) if o.sensor.name == "RS" else o
            for o in hidden.frame.observations
        ),
    )
    inputs = Frame(frame.step_s, frame.features, frame.boundaries)
    start, _ = initial_temperatures(cut, frame, "testing")
    open_loop = simulate(load_kernel(cut), inputs, start)
    found = filter_session(cut, frame, mean_losses(cut, inputs, open_loop), "testing")
    assert found is not None
    assert found.node.startswith("magnet")
    (kept,) = (o for o in frame.observations if o.sensor.name == "MAG")
    nodes = tuple(node.name for node in cut.nodes)
    off = [np.abs(kept.measured - modelled(kept, frame, t, nodes))[-600:] for t in (open_loop, found.temperatures)]
    assert np.nanmean(off[1]) < 0.5 * np.nanmean(off[0])
    assert found.heat_W[-600:].mean() > 1.3 * found.nominal_W[-600:].mean()
    assert found.smoothed is not None
    for heat_W, sd_W in ((found.heat_W, found.heat_sd_W), (found.smoothed.heat_W, found.smoothed.heat_sd_W)):
        assert (heat_W >= 0).all()
        assert 0 < sd_W[-600:].mean() < heat_W[-600:].mean()


def flows_of(replayed: Replayed) -> HeatFlows:
    inputs = Frame(replayed.frame.step_s, replayed.frame.features, replayed.frame.boundaries)
    return heat_flows(replayed.network, inputs, replayed.run.temperatures)


def metered(replayed: Replayed, what: Measurand, watts: Floats, bias_sd: float = 0.0) -> InputFrame:
    """The frame with a meter of power or heat beside its thermometers, which shows these watts."""
    (o,) = (o for o in replayed.frame.observations if o.sensor.name == "RS")
    seen = replace(
        o,
        sensor=Sensor("METER", {"METER": 1.0}, noise=1.0, bias_sd=bias_sd),
        measured=watts,
        samples=np.ones(watts.size, dtype=np.int64),
        good=np.isfinite(watts),
    )
    return replace(replayed.frame, meters=(Meter(what, seen),))


def test_the_error_of_a_power_meter_is_its_own_and_that_of_the_other_losses(hidden: Replayed) -> None:
    flows, mechanical = flows_of(hidden), hidden.frame.mechanical_W
    assert mechanical is not None
    frame = metered(hidden, Measurand("power", "W", 0.004), mechanical + flows.made, bias_sd=30.0)
    ((reading, error),) = heat_readings(frame.meters, hidden.network, frame, flows, "magnet")
    np.testing.assert_allclose(reading.value[frame.live], flows.made[frame.live])
    terms = [(source.node, term) for source in hidden.network.sources for term in source.terms]
    own = [(term.sd * flows.terms[i]) ** 2 for i, (node, term) in enumerate(terms) if node != "magnet"]
    variance = 30.0**2 + (0.004 * (mechanical + flows.made)) ** 2 + np.sum(own, axis=0)
    np.testing.assert_allclose(reading.variance, variance + reading.variance.min() - variance.min(), rtol=1e-9)
    assert error.sd_K == pytest.approx(np.sqrt(variance[frame.live].mean()))
    assert error.walk_K**2 * WANDERS_S == pytest.approx(error.sd_K**2)


def test_what_a_meter_scatters_by_from_step_to_step_is_noise_whatever_the_bench_file_says(hidden: Replayed) -> None:
    flows = flows_of(hidden)
    jitter = np.random.default_rng(1).normal(0.0, 200.0, len(flows.made))
    what = Measurand("heat", "W", 0.03, boundary="coolant")
    at = [b.name for b in hidden.network.boundaries].index("coolant")
    readings = []
    for extra in (0.0 * jitter, jitter):
        frame = metered(hidden, what, flows.boundaries[at] + extra)
        readings += [heat_readings(frame.meters, hidden.network, frame, flows, "magnet")[0][0]]
    assert np.median(readings[1].variance - readings[0].variance) == pytest.approx(200.0**2, rel=0.15)


@pytest.mark.parametrize("wrong_W", [0.0, 300.0, -300.0])
def test_a_power_meter_that_is_wrong_does_not_move_the_magnets(hidden: Replayed, wrong_W: float) -> None:
    flows, mechanical = flows_of(hidden), hidden.frame.mechanical_W
    assert mechanical is not None
    frame = metered(hidden, Measurand("power", "W", 0.004), mechanical + flows.made + wrong_W)
    found = filter_session(hidden.network, frame, losses(hidden), "testing")
    assert found is not None
    assert found.measured == ("EW_A_inner", "EW_B_inner", "RS", "METER")
    magnet = hidden.run.nodes.index("magnet")
    apart = np.abs(found.temperatures - filtered(hidden.run).temperatures)[:, magnet]
    assert apart.mean() < 0.3, "as much as by a meter that is right"


def test_a_power_meter_that_is_sure_finds_the_loss_where_no_thermometer_is_near(hidden: Replayed) -> None:
    """All other losses are those of the file, and the file says so."""
    sure = replace(
        hidden.network,
        sources=tuple(
            replace(source, terms=tuple(replace(term, sd=1e-4) for term in source.terms))
            for source in hidden.network.sources
        ),
    )
    flows, mechanical = flows_of(hidden), hidden.frame.mechanical_W
    assert mechanical is not None
    watts = mechanical + flows.made + 200.0
    away = ["EW_A_inner", "EW_B_inner"]
    frame = metered(hidden, Measurand("power", "W", 1e-5), watts)
    with_it = filter_session(sure, frame, losses(hidden), "testing", measured=[*away, "METER"])
    without = filter_session(sure, frame, losses(hidden), "testing", measured=away)
    assert with_it is not None
    assert without is not None
    late = slice(-1200, None)
    assert (with_it.heat_W - with_it.nominal_W)[late].mean() == pytest.approx(200.0, abs=20.0)
    assert abs((without.heat_W - without.nominal_W)[late].mean() - 200.0) > 50.0


def test_a_rotor_that_nothing_reads_is_little_further_off_than_by_the_open_loop(hidden: Replayed) -> None:
    """Which begins at what is measured there. What is wrong at the end windings was taken for heat of the magnets."""
    found = filter_session(
        hidden.network, hidden.frame, losses(hidden), "testing", measured=["EW_A_inner", "EW_B_inner"]
    )
    assert found is not None
    off = filter_summary(found, hidden.frame, hidden.run.nodes).mae_K
    open_loop = {one.channel: one.mae_K for one in hidden.run.summary.channels}
    for channel in ("MAG", "RS"):
        assert off[channel] < 1.25 * open_loop[channel], (off, open_loop)


def test_a_thermometer_that_is_off_within_its_bias_sd_moves_a_rotor_that_nothing_reads_less(hidden: Replayed) -> None:
    """It was heat that flows from the rotor."""
    ends, magnet = ["EW_A_inner", "EW_B_inner"], hidden.run.nodes.index("magnet")

    def moved(bias_sd: float) -> float:
        found = []
        for wrong_K in (0.0, 1.0):
            seen = []
            for o in hidden.frame.observations:
                sensor = replace(o.sensor, bias_sd=bias_sd)
                seen.append(replace(o, sensor=sensor, measured=o.measured + wrong_K * (o.sensor.name == ends[0])))
            frame = replace(hidden.frame, observations=tuple(seen))
            estimate = filter_session(hidden.network, frame, losses(hidden), "testing", measured=ends)
            assert estimate is not None
            found.append(estimate.temperatures[-1200:, magnet])
        return float(np.abs(found[1] - found[0]).mean())

    assert moved(1.0) < 0.5 * moved(0.0)


def test_the_summary_says_the_loss_in_a_few_numbers(hidden: Replayed) -> None:
    run, heat = filtered(hidden.run), hidden.event.summary["filtered"]["heat"]
    assert run.smoothed is not None
    assert heat["modelled_mean_W"] == pytest.approx(run.nominal_W.mean())
    for one, watts, sd in (
        (heat["filter"], run.heat_W, run.heat_sd_W),
        (heat["smoother"], run.smoothed.heat_W, run.smoothed.heat_sd_W),
    ):
        assert (one["mean_W"], one["max_W"]) == pytest.approx((watts.mean(), watts.max()))
        assert one["max_sd_W"] == pytest.approx(sd[watts.argmax()])
        assert one["sd_W"] == pytest.approx((sd**2).mean() ** 0.5)
        assert one["max_at_s"] == pytest.approx(watts.argmax() * 0.5, abs=0.5)
    errors = hidden.event.summary["filtered"]
    assert set(errors["read_mae_K"]) == set(errors["smoothed_read_mae_K"]) == {"EW_A_inner", "EW_B_inner", "RS"}
    assert max(errors["smoothed_read_mae_K"].values()) < 0.2


def test_the_smoothers_band_holds_the_hottest_magnet_that_the_open_loops_leaves_out(hidden: Replayed) -> None:
    (kept,) = (o for o in hidden.run.observed if o.channel == "MAG")
    hottest = kept.measured[kept.used].max()
    (low, high), spot = hidden.event.summary["hot_spots"]["magnet"]["ci95_degC"], "magnet"
    assert not low < hottest < high
    smooth = hidden.event.summary["filtered"]["hot_spots"][spot]
    low, high = smooth["ci95_degC"]
    assert low < hottest < high
    assert (smooth["node"], smooth["checked_by"]) == ("magnet", ["MAG"])
    assert filtered(hidden.run).smoothed is not None
    assert smooth["sd_K"] >= np.hypot(kept.bias_sd_K, hidden.event.summary["filtered"]["smoothed_mae_K"]["MAG"])


def test_without_a_channel_there_a_smoothers_hot_spot_has_no_band(hidden: Replayed) -> None:
    """Its own is that of noise and random walks, and several times too narrow."""
    blind = replace(
        hidden.frame, observations=tuple(o for o in hidden.frame.observations if not o.sensor.name.startswith("MAG"))
    )
    found = filter_session(hidden.network, blind, losses(hidden), "testing")
    assert found is not None
    assert hidden.run.summary.filtered is not None
    as_read = hidden.run.summary.filtered.hot_spots["magnet"]
    assert found.spots["magnet"] == replace(as_read, sd_K=None, ci95_degC=None, checked_by=[])
    assert found.spots["winding"].sd_K is not None


def asked(hidden: Replayed, *causes: str) -> Mapping[str, Unknown]:
    return asked_unknowns(hidden.network, causes, losses(hidden), hidden.frame.observations)


def test_what_is_found_and_from_what_can_be_said(hidden: Replayed) -> None:
    wanted = asked(hidden, "loss.rotor_surface.constant")
    found = filter_session(hidden.network, hidden.frame, losses(hidden), "testing", wanted, ["RS", "MAG"])
    assert found is not None
    assert (found.node, found.measured) == ("rotor_surface", ("RS", "MAG"))
    (one,) = filter_summary(found, hidden.frame, hidden.run.nodes).unknowns
    assert (one.id, one.unit) == ("loss.rotor_surface.constant", "W")
    assert found.smoothed is not None
    extra = found.smoothed.heat_W.mean() - found.nominal_W.mean()
    assert one.mean == pytest.approx(extra, abs=1.0), "temperatures differ, and with them what the model has"
    assert one.min < one.mean < one.max


def test_a_loss_as_a_factor_is_one_of_what_the_model_has(hidden: Replayed) -> None:
    found = filter_session(hidden.network, hidden.frame, losses(hidden), "testing", asked(hidden, "loss.magnet.scale"))
    assert found is not None
    assert found.node == "magnet"
    (one,) = filter_summary(found, hidden.frame, hidden.run.nodes).unknowns
    assert one.unit == "1"
    assert one.max == pytest.approx((found.smoothed.heat_W / found.nominal_W)[2:].max(), rel=0.05)  # type: ignore[union-attr]
    assert one.max > 1.5, "a loss is hidden there"


def test_a_conductance_is_found_beside_the_loss_of_the_magnets(hidden: Replayed) -> None:
    cause = "conductance.rotor_surface-teeth.scale"
    found = filter_session(hidden.network, hidden.frame, losses(hidden), "testing", asked(hidden, cause))
    assert found is not None
    assert found.node == "magnet"
    (one,) = filter_summary(found, hidden.frame, hidden.run.nodes).unknowns
    assert (one.id, one.unit) == (cause, "1")
    assert 0 < one.min <= one.mean <= one.max
    assert "unknowns" not in hidden.event.summary["filtered"], "nothing was asked for"


def test_an_error_of_a_thermometer_that_reads_too_much_is_found(hidden: Replayed) -> None:
    frame = replace(
        hidden.frame,
        observations=tuple(
            replace(o, measured=o.measured + 3.0, sensor=replace(o.sensor, bias_sd=3.0))
            if o.sensor.name == "EW_A_inner"
            else o
            for o in hidden.frame.observations
        ),
    )
    wanted = asked_unknowns(hidden.network, ["sensor.endwinding_a_inner.bias"], losses(hidden), frame.observations)
    found = {
        shift: filter_session(hidden.network, shifted, losses(hidden), "testing", wanted)
        for shift, shifted in ((3.0, frame), (0.0, hidden.frame))
    }
    means = {}
    for shift, one in found.items():
        assert one is not None
        (entry,) = filter_summary(one, frame, hidden.run.nodes).unknowns
        assert entry.unit == "K"
        means[shift] = entry.mean
    assert means[3.0] - means[0.0] == pytest.approx(3.0, abs=1.0)


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
    assert "T_3, kept" in plot.svg
    assert "estimated" in plot.svg
    assert plot.table.head[1:4] == ("estimated [W]", "standard deviation [W]", "modelled [W]")
    assert plot.table.rows[0][1:4] == (f"{14 + extra:.1f}", "5.0", "14.0")


def test_the_report_draws_measured_open_loop_filter_and_smoother(hidden: Replayed, tmp_path: Path) -> None:
    plot: Any = filter_over_time(hidden.run, 600)
    errors = hidden.event.summary["filtered"]
    (open_loop,) = (c["mae_K"] for c in hidden.event.summary["channels"] if c["channel"] == "MAG")
    assert plot.title == (
        f"Magnet (MAG, not read by the filter): open loop {open_loop:.1f} K off on average, "
        f"filter {errors['mae_K']['MAG']:.1f} K, smoother {errors['smoothed_mae_K']['MAG']:.1f} K"
    )
    for name in ("measured", "open loop", "filter", "smoother", "smoothed", "estimated", "modelled"):
        assert f">{name}<" in plot.svg
    assert plot.table.head[1:5] == ("measured [°C]", "open loop [°C]", "filter [°C]", "smoother [°C]")
    measured, *others = (float(cell) for cell in plot.table.rows[-1][1:5])
    assert abs(measured - others[0]) > 3 * abs(measured - others[2])
    write_report([hidden.run], tmp_path / "report.html", ReportContext("whyhot report", "4f0c", {}))
    page = (tmp_path / "report.html").read_text(encoding="utf-8").replace("\N{NO-BREAK SPACE}", " ")
    assert plot.title in page
    assert page.count("no evidence that the cause is there") == 1
    assert page.count("so it does not lag") == 1
    assert "hottest by the smoother" in page.lower()
    assert "of loss at the magnet on average" in page


def test_what_a_filter_leaves_of_a_channel_is_what_its_summary_says(hidden: Replayed) -> None:
    """The drawing makes it of sealed temperatures, the summary of the frame."""
    run = hidden.run
    (kept,) = (o for o in run.observed if o.channel == "MAG")
    lines = {name: values for name, values, _, _ in courses(run, filtered(run), kept)}
    errors = hidden.event.summary["filtered"]
    for name, mae in (("filter", errors["mae_K"]["MAG"]), ("smoother", errors["smoothed_mae_K"]["MAG"])):
        assert np.abs(kept.measured - lines[name])[kept.used].mean() == pytest.approx(mae, abs=0.05), (
            "but for the sensor's lag"
        )


def test_a_run_without_a_filter_or_a_channel_to_compare_has_no_such_drawing(hidden: Replayed) -> None:
    assert filter_over_time(made_run(), 600) is None
    assert hidden.run.summary.filtered is not None
    bare = replace(hidden.run.summary.filtered, mae_K={}, read_mae_K={})
    assert filter_over_time(replace(hidden.run, summary=replace(hidden.run.summary, filtered=bare)), 600) is None
