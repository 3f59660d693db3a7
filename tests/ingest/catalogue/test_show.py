"""The catalogue of a store: its sessions, and everything about one of them, as data and as text."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ingest.bench.bench_file import read_bench
from ingest.catalogue import page, show
from ingest.catalogue.channels import load
from ingest.errors import DamageError
from ingest.facts import facts as ledger_facts
from ingest.facts import sessions
from ingest.facts.events import BenchRegistered, DecodeCompleted, SessionRecorded
from ingest.facts.facts import Facts
from ingest.facts.store import Store
from ingest.log.samples import Column, GroupWriter, Samples
from made.events import decode, raw
from made.places import on_disk

S = 1_000_000_000
T0 = 1_760_000_000 * S  # 2025-10-09T08:53:20Z
N = 1200
T = np.arange(float(N))
BENCH = b"""
schema = "whyhot.bench/1"
specimen = "stator-07"
attributes = {inverter = "sw 4.2"}
[[channel]]
signal = "n"
quantity = "speed"
unit = "rpm"
[[channel]]
signal = "M"
quantity = "torque"
unit = "Nm"
[[channel]]
signal = "MAG_1"
quantity = "temperature"
unit = "degC"
node = "magnet"
resolution = 0.1
time_constant_s = 2.0
[[channel]]
signal = "spare"
quantity = "temperature"
unit = "degC"
role = "ignored"
[[derived]]
name = "P"
quantity = "power"
unit = "kW"
expression = "M * n / 9000"
"""
SHA = hashlib.sha256(BENCH).hexdigest()
COLUMNS = {  # signal -> column, quantity, stored unit, node, role
    "n": ("n_rpm", "speed", "rpm", None, "input"),
    "M": ("M_Nm", "torque", "Nm", None, "input"),
    "MAG_1": ("MAG_1_degC", "temperature", "degC", "magnet", "observed"),
    "spare": ("spare_degC", "temperature", "degC", None, "ignored"),
    "P": ("P_W", "power", "W", None, "input"),
    "note": ("note_Hz", None, "Hz", None, "ignored"),
}


def values(offset: float = 0.0) -> dict[str, NDArray[np.float64]]:
    magnet = np.round(60 + offset + T / 40 + np.random.default_rng(3).normal(0, 0.1, N), 1)
    magnet[400:700], magnet[700] = magnet[399] + 0.2, 90.0
    torque = 100 + 20 * np.sin(T / 40)
    return {
        "n": np.full(N, 3000.0),
        "M": torque,
        "MAG_1": magnet,
        "spare": np.full(N, 20.0),
        "P": torque * 314.16 * 1.1,
        "note": T,
    }


def entry(name: str, bench: bool) -> dict[str, Any]:
    column, quantity, unit, node, role = COLUMNS[name]
    signal = {"name": name, "message": None, "bus": None, "unit": None, "resolution": None, "source": None}
    said = {"name": name, "group": "rows", "column": column, "quantity": quantity, "unit": unit, "derived": name == "P"}
    return said | {"node": node, "role": role if bench else "input", "signal": None if name == "P" else signal}


def add(store: Store, name: str, start_s: int, bench: bool = True, **more: Any) -> DecodeCompleted:
    """A decoded table in the store: its products and its facts."""
    sealed = raw(name)
    number, without = hashlib.sha256(f"{name}{bench}".encode()).hexdigest(), more.pop("without", ())
    folder = on_disk(store.decoded(number))
    folder.mkdir(parents=True)
    columns = [Column(COLUMNS[one][0], one, COLUMNS[one][2], COLUMNS[one][1]) for one in COLUMNS]
    writer = GroupWriter(folder / "rows.parquet", sealed.sha256, columns)
    t_ns = T0 + (start_s + np.arange(N)) * S
    writer.add(Samples(t_ns, np.arange(N), list(more.pop("values", values()).values())))
    rows = writer.close()
    done = decode(
        number,
        sealed.sha256,
        SHA if bench else None,
        start_ns=int(t_ns[0]),
        end_ns=int(t_ns[-1]),
        groups=[{"name": "rows", "file": "rows.parquet", "rows": rows, "columns": [c.name for c in columns]}],
        channels=[entry(one, bench) for one in COLUMNS if one not in without],
        **({"balance": {"found": N, "decoded": N, "unknown_id": 0, "wrong_length": 0, "rejected": 0}} | more),
    )
    store.ledger.append(f"file-{sealed.sha256}", sealed)
    store.ledger.append(f"file-{sealed.sha256}", done)
    return done


def grouped(store: Store) -> Facts:
    known = ledger_facts.at(store.ledger)
    benches = {SHA: read_bench(BENCH, "bench.toml")} if SHA in known.benches else {}
    names = {sha: one.name for sha, one in known.files.items()}
    new = sessions.group(list(known.decodes.values()), benches, names)
    store.ledger.append_all([(f"session-{one.session}", one) for one in sessions.regroup(known.sessions, new)])
    return ledger_facts.at(store.ledger)


@pytest.fixture
def store(tmp_path: Path) -> Iterator[Store]:
    with Store.open(tmp_path / "store", create=True) as opened:
        opened.archive.seal(BENCH)
        registered = BenchRegistered(sha256=SHA, name="bench.toml", motor="reference-150kW", model=None)
        opened.ledger.append(f"bench-{SHA}", registered)
        yield opened


def one_session(store: Store, **more: Any) -> tuple[Facts, SessionRecorded]:
    add(store, "3_wltp.csv", 0, **more)
    facts = grouped(store)
    return facts, facts.session("3_wltp")


def test_channels_are_those_of_the_bench_file_in_stored_units_with_every_default(store: Store) -> None:
    channels = load(store, *one_session(store))
    assert [one.spec.name for one in channels] == ["n", "M", "MAG_1", "spare", "P"]
    magnet = channels[2]
    assert (magnet.spec.node, magnet.spec.role, magnet.unit, magnet.place) == ("magnet", "observed", "degC", "magnet")
    assert (magnet.spec.resolution, magnet.spec.noise, magnet.spec.bias_sd, magnet.spec.time_constant_s) == (
        0.1,
        0.1,
        0.5,
        2.0,
    )
    assert channels[4].value[0] == values()["P"][0]  # converted when it was decoded, not once more
    assert magnet.t_ns[0] == T0 and magnet.record[-1] == N - 1
    assert channels[1].spec.resolution == pytest.approx(np.abs(np.diff(values()["M"])).min())


def test_a_channel_runs_over_all_files_of_the_session_in_the_order_of_time(store: Store) -> None:
    add(store, "b.csv", N + 30, values=values(30.0))
    add(store, "a.csv", 0)
    facts = grouped(store)
    (session,) = facts.sessions
    magnet = load(store, facts, session)[2]
    assert len(magnet.t_ns) == 2 * N and (np.diff(magnet.t_ns) > 0).all()
    assert [magnet.raws[i] for i in magnet.raw[[0, -1]]] == [raw("a.csv").sha256, raw("b.csv").sha256]
    assert magnet.record[[0, N - 1, N, -1]].tolist() == [0, N - 1, 0, N - 1]
    description = show.describe(store, facts, session)
    assert [gap.longest_s for gap in description.channels[2].repeats if gap.kind == "gap"] == [31.0]
    assert [source.file for source in description.sources] == ["a.csv", "b.csv"]


def test_empty_cells_and_rows_of_another_session_are_left_out(store: Store) -> None:
    given = values()
    given["M"][::2] = np.nan
    given["spare"][:] = np.nan
    facts, session = one_session(store, values=given)
    half = replace(session, files=[session.files[0] | {"first_record": 100, "last_record": 199}])
    channels = {one.spec.name: one for one in load(store, facts, half)}
    assert "spare" not in channels
    assert channels["M"].record.tolist() == list(range(101, 200, 2))
    assert len(channels["n"].value) == 100


def test_without_a_bench_file_signals_have_guessed_quantities_or_none(store: Store) -> None:
    facts, session = one_session(store, bench=False)
    assert session.bench is None
    channels = {one.spec.name: one for one in load(store, facts, session)}
    assert list(channels) == list(COLUMNS)
    assert (channels["n"].spec.quantity, channels["n"].unit) == ("speed", "rpm")
    assert (channels["note"].spec.quantity, channels["note"].unit) == ("", "Hz")
    assert show.describe(store, facts, session).channels[5].quantity is None


def test_missing_samples_say_how_to_make_them_again(store: Store) -> None:
    facts, session = one_session(store)
    path = on_disk(store.decoded(session.files[0]["decode"])) / "rows.parquet"
    path.unlink()
    with pytest.raises(DamageError) as error:
        load(store, facts, session)
    assert (
        str(error.value)
        == f"{path}: the samples are not there. Make them again from the archive with `whyhot rebuild`."
    )


def test_a_description_holds_everything_that_is_known(store: Store) -> None:
    found = show.describe(store, *one_session(store))
    assert (found.name, found.start, found.duration_s) == ("3_wltp", "2025-10-09T08:53:20Z", 1199.0)
    assert (found.motor, found.bench, found.specimen) == ("reference-150kW", "bench.toml", "stator-07")
    assert found.attributes == {"inverter": "sw 4.2"}
    magnet = found.channels[2]
    assert [(one.kind, one.times, one.longest_s) for one in magnet.repeats] == [("held", 1, 299.0)]
    assert found.findings == ("MAG_1 is held at 70.1 for 299 s: masked",)
    assert found.power is not None and found.power.electrical_from == "channel P"
    assert found.operating_points is not None
    assert sum(map(sum, found.operating_points.minutes)) == pytest.approx(20.0)
    assert found.sources[0].holds


def test_a_sensor_without_a_value_is_to_be_looked_at_and_one_that_is_ignored_is_not(store: Store) -> None:
    given = values()
    given["MAG_1"][:] = given["spare"][:] = np.nan
    assert show.describe(store, *one_session(store, values=given)).findings == ("MAG_1 has no value at all",)


def test_a_thermometer_of_the_bench_file_that_no_log_holds_is_to_be_looked_at(store: Store) -> None:
    """Before, a column that was missing on one day was compared with nothing, in silence."""
    facts, session = one_session(store, without=("MAG_1", "spare"))
    missing = "MAG_1 (magnet): in the bench file, and in none of its logs"
    assert show.describe(store, facts, session).findings == (missing,)
    assert show.describe(store, facts, replace(session, kind="dc_check")).findings == ()


def test_the_answer_is_json(store: Store) -> None:
    answer = json.loads(json.dumps(show.describe(store, *one_session(store)).to_json()))
    assert answer["schema"] == "whyhot.show/1"
    assert answer["channels"][2]["node"] == "magnet"
    assert answer["power"]["possible"] is True
    assert answer["sources"][0]["balance"]["found"] == N and answer["sources"][0]["holds"] is True


def test_the_page_says_kind_sources_channels_power_and_points(store: Store) -> None:
    description = show.describe(store, *one_session(store))
    text = page.render(description)
    for heading in ("Sources", "Look at", "Channels (4, and 1 ignored)", "Power", "Operating points"):
        assert f"\n{heading}\n" in text
    assert "decoded 1,200 · unknown id 0 · wrong length 0 · rejected 0   balance holds" in text
    assert "2025-10-09 08:53:20 UTC, 0:19:59, session " in text
    assert "inverter = sw 4.2" in text
    assert text.endswith("next: whyhot replay 3_wltp")
    mag = next(line for line in text.splitlines() if "MAG_1  " in line).split()
    assert (mag[2], mag[-2:]) == ("°C", ["299", "s"])
    assert max(map(len, text.splitlines())) <= 100
    assert max(map(len, page.render(description, width=72).splitlines())) <= 72


def test_a_gap_of_all_channels_is_one_line(store: Store) -> None:
    found = show.describe(store, *one_session(store))
    silent = [replace(found.channels[0], name=f"T_{i}") for i in range(9)]
    gaps = [f"{one.name} has no samples for {'15 min' if i < 8 else '3.0 s'}" for i, one in enumerate(silent)]
    text = page.render(replace(found, channels=tuple(silent), findings=("a log is cut", *gaps)))
    assert (
        "\n  a log is cut\n  T_0, T_1, T_2 and 5 more have no samples for 15 min\n  T_8 has no samples for 3.0 s\n"
        in text
    )


def test_noise_has_two_digits_and_no_power_of_ten_and_what_is_best_is_named(store: Store) -> None:
    found = show.describe(store, *one_session(store))
    loud = tuple(replace(one, noise=204.3) for one in found.channels)
    text = page.render(replace(found, channels=loud))
    assert " 200\n" in text and "2e+02" not in text
    assert "best efficiency " in text


def test_what_a_replay_lacks_is_the_next_step(store: Store) -> None:
    found = show.describe(store, *one_session(store))
    without_motor = page.render(replace(found, motor=None), width=200).splitlines()[-1]
    assert without_motor == (
        'next: add motor = "motor.toml" to bench.toml and ingest again, or whyhot replay 3_wltp --model motor.toml'
    )
    without_bench = page.render(replace(found, bench=None, motor=None), width=200).splitlines()[-1]
    assert without_bench == (
        "next: no bench file says yet what these signals mean: whyhot inspect FILE... --bench-draft bench.toml"
    )


def test_records_are_told_where_a_part_of_a_file_is_meant_only(store: Store) -> None:
    add(store, "b.csv", N + 30)
    add(store, "a.csv", 0)
    facts = grouped(store)
    (session,) = facts.sessions
    whole = page.render(show.describe(store, facts, session))
    assert whole.count("1,200 records   sealed") == 2 and "records 0 to" not in whole
    part = replace(session, files=[session.files[0] | {"first_record": 100, "last_record": 199}])
    assert "1,200 records, records 100 to 199   sealed" in page.render(show.describe(store, facts, part))


def test_lost_records_are_told_on_the_page(store: Store) -> None:
    balance = {"found": N + 5, "decoded": N, "unknown_id": 2, "wrong_length": 1, "rejected": 1}
    bad = [{"record": 7, "where": "line 9", "why": "no number in column M"}]
    more = {"balance": balance, "rejections": bad, "outcome": "salvaged", "why": "3_wltp.csv: ends in line 1206"}
    facts, session = one_session(store, unknown_ids={"can1:0x123": 2}, **more)
    text = page.render(show.describe(store, facts, session))
    assert "unknown id 2 · wrong length 1 · rejected 1   BALANCE DOES NOT HOLD" in text
    assert "salvaged: 3_wltp.csv: ends in line 1206" in text
    assert "rejected at line 9: no number in column M" in text
    assert "unknown: can1:0x123 2" in text


def test_the_list_of_sessions_follows_its_schema(store: Store) -> None:
    add(store, "10_s1.csv", 90_000)
    balance = {"found": N, "decoded": N - 5, "unknown_id": 0, "wrong_length": 2, "rejected": 3}
    add(store, "2_s2.csv", 5_000, absolute=False, balance=balance)
    lost = raw("broken.blf")
    why = "broken.blf: is no BLF file"
    quarantined = decode("c0ffee", lost.sha256, None, outcome="quarantined", why=why, start_ns=None, end_ns=None)
    store.ledger.append_all([(f"file-{lost.sha256}", lost), (f"file-{lost.sha256}", quarantined)])
    facts = grouped(store)
    answer = show.sessions_json(facts)
    assert answer["schema"] == "whyhot.sessions/1"
    first, second = answer["sessions"]
    assert first == {
        "session": facts.sessions[0].session,
        "name": "10_s1",
        "start": "2025-10-10T09:53:20Z",
        "duration_s": 1199.0,
        "kind": "",
        "motor": "reference-150kW",
        "specimen": "stator-07",
        "batch": None,
        "sources": ["10_s1.csv"],
        "channels": 4,
        "quarantined": 0,
    }
    assert (second["name"], second["start"], second["quarantined"]) == ("2_s2", None, 5)
    assert answer["quarantined_files"] == [{"file": "broken.blf", "sha256": lost.sha256, "why": why}]
    text = page.sessions(show.sessions_json(facts))
    assert text.splitlines()[0] == "2 sessions"
    assert "quarantined: broken.blf: is no BLF file" in text
    assert text.endswith("next: whyhot show 2_s2")
    assert max(map(len, text.splitlines())) <= 100


def test_an_empty_store_says_how_to_begin(store: Store) -> None:
    assert (
        page.sessions(show.sessions_json(grouped(store)))
        == "No session in this store yet.\nnext: whyhot ingest FILE..."
    )


def test_a_store_without_sessions_at_a_point_says_so(store: Store) -> None:
    early = page.sessions(show.sessions_json(grouped(store)), as_of="2")
    assert early == "No session was known as of 2.\nnext: whyhot sessions"


def test_a_table_too_wide_loses_the_ends_of_its_widest_column() -> None:
    lines = page.table(("name", "x"), [("a" * 50, "1"), ("b", "22")], width=20, right=(1,))
    assert lines == ["name               x", "a" * 15 + "…   1", "b                 22"]


def test_a_column_in_which_nothing_stands_is_not_missed_where_it_does_not_fit() -> None:
    rows = [("a" * 30, "1", ""), ("b", "22", "")]
    assert "not shown" not in "\n".join(page.table(("name", "x", "held"), rows, width=16, right=(1,)))
    told = page.table(("name", "x", "held"), [*rows, ("c", "3", "10 s")], width=16, right=(1,))
    assert "held" in " ".join(told[4:])


def test_a_table_much_too_wide_cuts_no_number_and_names_the_columns_that_it_leaves_out() -> None:
    rows = [("magnet", "1,234.5 K", "within it by far", "2025-10-09"), ("b", "2 K", "x", "–")]
    lines = page.table(("name", "mean", "verdict", ""), rows, width=27, right=(1,))
    assert lines == [
        "name         mean  verdict",
        "magnet  1,234.5 K  within …",
        "b             2 K  x",
        "not shown, as 27 columns",
        "  are too few: notes",
    ]


@pytest.mark.parametrize(("t_ns", "text"), [(T0, "2025-10-09T08:53:20Z"), (T0 + 7_000_000, "2025-10-09T08:53:20.007Z")])
def test_stamps_are_utc_with_milliseconds_where_needed(t_ns: int, text: str) -> None:
    assert show.iso(t_ns) == text
