"""Sessions under a bench file with corrections: what is loaded is the truth that the readings were made from."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from ingest.catalogue.channels import ChannelData, load
from ingest.facts import facts as ledger_facts
from ingest.facts.events import BenchRegistered, CauseAccepted
from ingest.facts.store import Store
from made import can_bench
from replay.cli import main
from replay.engine.files.bench_text import corrected

START_NS = 1_760_000_000 * 10**9
N = 1200
T_S = np.arange(N, dtype=np.float64)
HOURS = T_S / 3600.0
BENCH = """\
schema = "whyhot.bench/1"
specimen = "motor-1"
[time]
column = "stamp"
unit = "s"
start = 2025-10-09T08:53:20Z
[[channel]]
signal = "T_magnet"
quantity = "temperature"
unit = "degC"
node = "magnet"
[[channel]]
signal = "T_teeth"
quantity = "temperature"
unit = "degC"
node = "teeth"
[[channel]]
signal = "T_yoke"
quantity = "temperature"
unit = "degC"
node = "yoke"
[[channel]]
signal = "T_rotor"
quantity = "temperature"
unit = "degC"
node = "rotor"
[[channel]]
signal = "T_room"
quantity = "temperature"
unit = "degC"
node = "ambient"
[[channel]]
signal = "T_water"
quantity = "temperature"
unit = "degC"
node = "coolant"
[[channel]]
signal = "I"
quantity = "current"
unit = "A"
[[channel]]
signal = "n"
quantity = "speed"
unit = "rpm"
[[channel]]
signal = "Q"
quantity = "flow"
unit = "l/min"
"""
Floats = NDArray[np.float64]

TRUTH = {
    "T_magnet": 60.0 + T_S / 20.0,
    "T_teeth": 50.0 + T_S / 30.0,
    "T_yoke": 40.0 + T_S / 60.0,
    "T_rotor": 45.0 + T_S / 40.0,
    "T_room": 22.0 + T_S / 600.0,
    "T_water": 30.0 + 0.1 * (T_S % 7),
    "I": 100.0 + T_S % 50,
    "n": 20.0 * (T_S % 300) - 3000.0,
    "Q": 8.0 + 0.01 * (T_S % 11),
}
CORRECTIONS = {
    "sensor.magnet.bias": 3.1,
    "sensor.magnet.lag": 6.0,
    "sensor.teeth.drift": 2.0,
    "sensor.yoke.stem": 0.08,
    "sensor.rotor.speed": -0.5,
    "sensor.rotor.current": 0.3,
    "boundary.ambient.bias": 1.5,
    "boundary.coolant.bias": -2.0,
    "input.current.gain": 0.05,
    "input.flow.bias": 0.5,
    "clock.hot.offset": 4.0,
    "clock.hot.lag": 2.5,
    "clock.water.drift": 500.0,
    "clock.elsewhere.offset": 60.0,
}


def readings() -> dict[str, Floats]:
    return {
        "T_magnet": TRUTH["T_magnet"] + 3.1,
        "T_teeth": TRUTH["T_teeth"] + 2.0 * HOURS,
        "T_yoke": TRUTH["T_yoke"] + 0.08 * (TRUTH["T_room"] - TRUTH["T_yoke"]),
        "T_rotor": TRUTH["T_rotor"] - 0.5 * np.abs(TRUTH["n"]) / 1000.0 + 0.3 * TRUTH["I"] / 100.0,
        "T_room": TRUTH["T_room"] + 1.5,
        "T_water": TRUTH["T_water"] - 2.0,
        "I": TRUTH["I"] * 1.05,
        "n": TRUTH["n"],
        "Q": TRUTH["Q"] + 0.5,
    }


def _table(path: Path, stamp_s: Floats, names: list[str], values: dict[str, Floats]) -> None:
    columns = np.stack([values[name] for name in names], axis=1).tolist()
    rows = [",".join(map(repr, [stamp, *row])) for stamp, row in zip(stamp_s.tolist(), columns, strict=True)]
    path.write_text("\n".join([",".join(["stamp", *names]), *rows]) + "\n", encoding="utf-8")


def ingested(folder: Path, values: dict[str, Floats], bench: str = BENCH) -> None:
    """Three tables of one session: `drive` on time, `hot` late by 4 s, and `water`, whose clock drifts by 500 ppm."""
    _table(folder / "drive.csv", T_S, ["I", "n", "Q"], values)
    _table(folder / "hot.csv", T_S + 4.0, ["T_magnet", "T_teeth", "T_yoke", "T_rotor", "T_room"], values)
    _table(folder / "water.csv", T_S * (1 + 500e-6), ["T_water"], values)
    (folder / "bench.toml").write_text(bench, encoding="utf-8")
    logs = [str(folder / f"{name}.csv") for name in ("drive", "hot", "water")]
    assert main(["ingest", *logs, "--bench", str(folder / "bench.toml"), "--store", str(folder / "store")]) == 0


def accepted(store: Store, corrections: dict[str, float]) -> None:
    """The bench file with corrections, accepted in place of the one that is current."""
    facts = ledger_facts.at(store.ledger)
    parent = facts.bench_of(facts.sessions[0])
    assert parent is not None
    sha = store.archive.seal(corrected(store.archive.read(parent.sha256), parent.name, corrections, "A test."))
    child = BenchRegistered(sha256=sha, name=parent.name, motor=parent.motor, model=parent.model)
    store.ledger.append(f"bench-{sha}", child)
    accepted = CauseAccepted(
        diagnosis="4f0c", causes=list(corrections), parent=None, model=None, parent_bench=parent.sha256, bench=sha
    )
    store.ledger.append("diagnosis-4f0c", accepted)


def loaded(store: Store, as_of: str | None = None) -> dict[str, ChannelData]:
    facts = ledger_facts.at(store.ledger, as_of)
    (session,) = facts.sessions
    return {one.spec.name: one for one in load(store, facts, session)}


def before(store: Store) -> str:
    """The event before the first acceptance."""
    return str(store.ledger.events(CauseAccepted)[0].position - 1)


@pytest.fixture(scope="module")
def store_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("corrected")
    ingested(folder, readings())
    with Store.open(folder / "store", write=True) as store:
        accepted(store, CORRECTIONS)
    return folder / "store"


def test_loaded_values_and_times_are_the_truth(store_folder: Path) -> None:
    with Store.open(store_folder) as store:
        channels = loaded(store)
    assert set(channels) == set(TRUTH)
    for name, channel in channels.items():
        assert channel.value == pytest.approx(TRUTH[name], abs=1e-9), name
        assert (channel.t_ns - START_NS) / 1e9 == pytest.approx(T_S, abs=2e-6), name
    assert channels["T_magnet"].spec.time_constant_s == 8.5
    assert channels["T_teeth"].spec.time_constant_s == 2.5
    assert channels["T_water"].spec.time_constant_s == 0.0


def test_before_the_acceptance_everything_is_as_it_was_read(store_folder: Path) -> None:
    with Store.open(store_folder) as store:
        channels = loaded(store, as_of=before(store))
    for name, channel in channels.items():
        assert channel.value.tolist() == readings()[name].tolist(), name
        assert channel.read is None
    assert (channels["T_magnet"].t_ns[0] - START_NS) / 1e9 == pytest.approx(4.0)


def test_the_values_as_they_were_read_stay_beside_the_corrected_ones(store_folder: Path) -> None:
    with Store.open(store_folder) as store:
        channels = loaded(store)
    for name, channel in channels.items():
        assert channel.recorded.tolist() == readings()[name].tolist(), name


def test_a_channel_knows_what_stamped_it(store_folder: Path) -> None:
    with Store.open(store_folder) as store:
        buses = {name: channel.buses for name, channel in loaded(store).items()}
    assert buses["T_magnet"] == ("hot",)
    assert buses["I"] == ("drive",)
    assert buses["T_water"] == ("water",)


def test_the_session_keeps_its_id_and_points_to_the_new_bench_file(store_folder: Path) -> None:
    with Store.open(store_folder) as store:
        now = ledger_facts.at(store.ledger)
        then = ledger_facts.at(store.ledger, before(store))
        assert [one.session for one in now.sessions] == [one.session for one in then.sessions]
        old, new = then.bench_of(then.sessions[0]), now.bench_of(now.sessions[0])
    assert old is not None and new is not None
    assert new.sha256 != old.sha256


def test_a_second_acceptance_follows_the_first(tmp_path: Path) -> None:
    ingested(tmp_path, readings())
    with Store.open(tmp_path / "store", write=True) as store:
        accepted(store, {"sensor.magnet.bias": 1.1})
        accepted(store, {"sensor.magnet.bias": 2.0, "sensor.magnet.swap_teeth": 1.0})
        channels = loaded(store)
    assert channels["T_magnet"].value == pytest.approx(TRUTH["T_magnet"], abs=1e-9)
    assert (channels["T_magnet"].spec.node, channels["T_teeth"].spec.node) == ("teeth", "magnet")


def test_a_bench_file_with_corrections_of_its_own_is_taken_as_it_is(tmp_path: Path) -> None:
    own = BENCH + '[[correction]]\ncause = "sensor.teeth.swap_magnet"\namount = 1\n'
    ingested(tmp_path, TRUTH, own + '[[correction]]\ncause = "sensor.teeth.bias"\namount = 2.5\n')
    with Store.open(tmp_path / "store") as store:
        channels = loaded(store)
    assert channels["T_magnet"].spec.node == "teeth"
    assert channels["T_magnet"].value == pytest.approx(TRUTH["T_magnet"] - 2.5)
    assert channels["T_teeth"].value.tolist() == TRUTH["T_teeth"].tolist()


def test_a_session_without_the_ambient_keeps_the_heat_along_the_leads(tmp_path: Path) -> None:
    values = readings() | {"T_room": np.full(N, np.nan)}
    ingested(tmp_path, values)
    with Store.open(tmp_path / "store", write=True) as store:
        accepted(store, {"sensor.yoke.stem": 0.08, "sensor.yoke.bias": 1.0})
        channels = loaded(store)
    assert "T_room" not in channels
    assert channels["T_yoke"].value == pytest.approx(readings()["T_yoke"] - 1.0)


def test_the_clock_of_a_can_bus_is_put_right_for_its_channels_alone(tmp_path: Path) -> None:
    can_bench.write_files(tmp_path)
    can_bench.write_log(tmp_path / "1_drive.blf", seconds=60)
    words = [
        str(tmp_path / "1_drive.blf"),
        "--bench",
        str(tmp_path / "bench.toml"),
        "--dbc",
        str(tmp_path / "bench.dbc"),
    ]
    assert main(["ingest", *words, "--store", str(tmp_path / "store")]) == 0
    with Store.open(tmp_path / "store", write=True) as store:
        late = loaded(store)["TC_winding"]
        (bus,) = late.buses
        assert bus.startswith("can")
        accepted(store, {f"clock.{bus}.offset": 2.0, "clock.can7.offset": 5.0})
        moved = loaded(store)["TC_winding"]
    assert (late.t_ns - moved.t_ns).tolist() == [2_000_000_000] * late.t_ns.size
