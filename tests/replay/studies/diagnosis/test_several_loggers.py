"""Sessions of several loggers: other names for one sensor, another bench file, a channel more or less.

The winding of `can_bench`'s motor reads 12 K too much in every log, and its magnets are hotter than the file says.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ingest.bench.bench_file import read_bench
from ingest.errors import BenchFileError
from ingest.facts import facts as ledger_facts
from ingest.facts.facts import Facts
from ingest.facts.store import Store
from made import can_bench
from replay.cli import main
from replay.studies.diagnosis import diagnose, offered
from twin.errors import DivergedError

Capture = pytest.CaptureFixture[str]

DRIVES = {"1_a": (600, 1), "2_b": (600, 2), "3_c": (2000, 3), "4_d": (600, 4)}  # seconds, seed
SESSIONS = ("1_a", "2_b", "3_c")
ASKED = ("diagnose", "--on", "1_a", "2_b", "--hold-out", "3_c")
PLAIN = ("TC_winding", "TC_yoke", "TC_magnet")
OURS = ("T_Wickl", "T_Rücken", "T_Magnet")
THEIRS = ("T_avvolg", "T_giogo", "T_magn")
INPUTS = ("n", "I", "T_in")
NODES = ("winding", "yoke", "magnet")
TOO_MUCH_K = 12.0  # reading less truth at the winding


def write_log(
    folder: Path,
    name: str,
    columns: Mapping[str, str],
    inputs: tuple[str, str, str] = INPUTS,
    too_much_K: float = TOO_MUCH_K,
) -> Path:
    """A table of 1 Hz; `columns`: name -> node that it reads; `inputs`: names of speed, current and coolant."""
    seconds, seed = DRIVES[name]
    speed, current = can_bench.drive(seconds, seed)
    shown = can_bench.truth(speed, current, 30.0, magnet_loss=90.0)[:-1] + np.array([too_much_K, 0.0, 0.0])
    t_s = can_bench.START + np.arange(seconds) + 86_400.0 * seed
    read = [shown[:, NODES.index(node)] for node in columns.values()]
    table = np.column_stack([t_s, speed[::10], current[::10], np.full(seconds, 30.0), *read])
    path = folder / f"{name}.csv"
    header = ",".join(["epoch_s", *inputs, *columns])
    np.savetxt(path, table, "%.2f", ",", header=header, comments="", encoding="utf-8")
    return path


def bench(*names: Mapping[str, str], inputs: tuple[str, str, str] = INPUTS) -> str:
    """A bench file for tables with these columns of temperature, and of speed, current and coolant."""
    speed, current, coolant = inputs
    tables = ['schema = "whyhot.bench/1"\nmotor = "motor.toml"\nspecimen = "servo-01"\n[time]\ncolumn = "epoch_s"']
    tables += [
        f'[[channel]]\nsignal = "{name}"\nquantity = "{quantity}"\nunit = "{unit}"'
        for name, quantity, unit in ((speed, "speed", "rpm"), (current, "current", "A"))
    ]
    for name, node in {coolant: "coolant"}.items() | {c: n for some in names for c, n in some.items()}.items():
        tables.append(f'[[channel]]\nsignal = "{name}"\nquantity = "temperature"\nunit = "degC"\nnode = "{node}"')
    return "\n".join(tables) + "\n"


def columns(names: tuple[str, ...] = PLAIN, but: Mapping[str, str | None] | None = None) -> dict[str, str]:
    """Column -> node; `but`: node -> another name of its column, or None where there is none."""
    found: dict[str, str | None] = {**dict(zip(NODES, names, strict=True)), **(but or {})}
    return {name: node for node, name in found.items() if name}


def ingested(folder: Path, logs: Mapping[str, Mapping[str, str]]) -> Path:
    """A store of these sessions; those of one vocabulary come with one bench file."""
    (folder / "motor.toml").write_text(can_bench.MOTOR, encoding="utf-8")
    for number, (name, own) in enumerate(logs.items()):
        path = folder / f"bench_{number}.toml"
        path.write_text(bench(own), encoding="utf-8")
        words = ["ingest", str(write_log(folder, name, own)), "--bench", str(path)]
        assert main([*words, "--store", str(folder / "store")]) == 0
    return folder / "store"


def asked(store: Path, capsys: Capture, code: int = 0, words: tuple[str, ...] = ASKED) -> dict[str, Any]:
    capsys.readouterr()
    assert main([*words, "--json", "--store", str(store)]) == code, capsys.readouterr().err
    answer: dict[str, Any] = json.loads(capsys.readouterr().out)
    return answer


def facts_of(store: Path) -> Facts:
    with Store.open(store) as opened:
        return ledger_facts.at(opened.ledger)


def corrections(store: Path, sha256: str) -> dict[str, float]:
    with Store.open(store) as opened:
        return {one.cause: one.amount for one in read_bench(opened.archive.read(sha256), "bench.toml").corrections}


@pytest.mark.parametrize(
    ("kept", "said"),
    [
        pytest.param(
            columns(but={"yoke": "Yoke"}),
            {
                "Yoke is in no session that was learnt from: not compared",
                "TC_yoke has no usable sample in this session: yoke is not compared",
            },
            id="another name",
        ),
        pytest.param(
            columns() | {"Yoke": "yoke"}, {"Yoke is in no session that was learnt from: not compared"}, id="one more"
        ),
        pytest.param(
            columns(but={"yoke": None}),
            {"TC_yoke has no usable sample in this session: yoke is not compared"},
            id="one fewer",
        ),
    ],
)
def test_a_kept_session_with_other_channels_is_compared_by_those_that_were_learnt_from(
    tmp_path: Path, capsys: Capture, kept: Mapping[str, str], said: set[str]
) -> None:
    answer = asked(ingested(tmp_path, {"1_a": columns(), "2_b": columns(), "3_c": kept}), capsys)
    assert [cause["id"] for cause in answer["causes"]] == ["sensor.winding.bias"]
    assert {one["says"] for one in answer["masked"] if one["session_name"] == "3_c"} == said
    yoke = "yoke" in {gain["node"] for gain in answer["gain"]}
    assert yoke == ("TC_yoke" in kept)
    assert {"winding", "magnet"} <= {gain["node"] for gain in answer["gain"]}


def change(channel: str, key: str, value: str) -> str:
    """From between `1_a` and `2_b` on."""
    return f'[[change]]\nfrom = 2025-10-11\nchannel = "{channel}"\n{key} = "{value}"\n'


@pytest.mark.parametrize(
    ("key", "value", "why"),
    [("signal", "T_Wickl", None), ("sensor", "TC-9", "from before and after a change of the bench were learnt from")],
)
def test_a_signal_that_was_renamed_is_one_channel_and_another_sensor_is_not(
    tmp_path: Path, capsys: Capture, key: str, value: str, why: str | None
) -> None:
    renamed = columns(but={"winding": "T_Wickl"}) if key == "signal" else columns()
    logs = {"1_a": columns(), "2_b": renamed, "3_c": renamed}
    (tmp_path / "motor.toml").write_text(can_bench.MOTOR, encoding="utf-8")
    (tmp_path / "bench.toml").write_text(bench(columns()) + change("TC_winding", key, value), encoding="utf-8")
    words = [str(write_log(tmp_path, name, own)) for name, own in logs.items()]
    store = tmp_path / "store"
    assert main(["ingest", *words, "--bench", str(tmp_path / "bench.toml"), "--store", str(store)]) == 0
    answer = asked(store, capsys)
    assert [cause["id"] for cause in answer["causes"]] == ["sensor.winding.bias"]
    if why is None:
        assert answer["why_no_files"] is None
        assert set(corrections(store, answer["extended_bench"])) >= {"sensor.winding.bias"}
    else:
        assert answer["extended_bench"] is None and why in json.dumps(answer)


def test_a_kept_session_of_which_nothing_was_learnt_is_no_kept_session(tmp_path: Path, capsys: Capture) -> None:
    store = ingested(tmp_path, {"1_a": columns(), "2_b": columns(), "3_c": columns(OURS)})
    answer = asked(store, capsys)
    assert answer["held_out"] == [] and answer["gain"] == []
    (said,) = (one["says"] for one in answer["masked"])
    assert said.startswith("T_Wickl and 2 more are in no session that was learnt from: nothing of this session is")
    assert "[[change]]" in said
    assert not facts_of(store).opened, "nothing of it was looked at"


def test_a_diagnosis_without_an_answer_spends_no_kept_session(
    tmp_path: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = ingested(tmp_path, dict.fromkeys(SESSIONS, columns()))

    def broken(*_: object) -> None:
        raise DivergedError("temperatures run away")

    with monkeypatch.context() as patch:
        patch.setattr(diagnose, "find", broken)
        assert "temperatures run away" in asked(store, capsys, code=2)["error"]
    assert not facts_of(store).opened
    assert asked(store, capsys)["opened_before"] is False
    assert list(facts_of(store).opened) == asked(store, capsys)["held_out"]


@pytest.mark.parametrize(
    ("step", "error", "why", "replayed"),
    [
        ("version", BenchFileError("bench.toml: no place"), "bench.toml: no place", {"published"}),
        ("as_recorded", DivergedError("temperatures run away"), "in a replay temperatures run away", set()),
    ],
)
def test_what_no_file_can_say_does_not_lose_the_answer(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: Capture,
    step: str,
    error: Exception,
    why: str,
    replayed: set[str],
) -> None:
    def refused(*_: object) -> None:
        raise error

    store = ingested(tmp_path, dict.fromkeys(SESSIONS, columns()))
    monkeypatch.setattr(offered, step, refused)
    answer = asked(store, capsys)
    assert answer["why_no_files"] == why
    assert answer["recalibrated_model"] is None and answer["extended_model"] is None
    assert [(cause["id"], cause["improved"]) for cause in answer["causes"]] == [("sensor.winding.bias", False)]
    assert [gain["mae_recorded_K"].keys() for gain in answer["gain"]] == [replayed] * len(NODES)
    assert main([*ASKED, "--store", str(store)]) == 0
    assert why in " ".join(capsys.readouterr().out.split())


def test_a_correction_is_written_to_every_bench_file_that_has_its_signal(tmp_path: Path, capsys: Capture) -> None:
    other = columns(but={"yoke": "Yoke"})
    store = ingested(tmp_path, {"1_a": columns(), "2_b": other, "3_c": other})
    answer = asked(store, capsys)
    assert answer["why_no_files"] is None
    (cause,) = answer["causes"]
    assert cause["id"] == "sensor.winding.bias"
    benches = {s.name: facts_of(store).bench_of(s) for s in facts_of(store).sessions}
    assert answer["extended_benches"].keys() == {one.sha256 for one in benches.values() if one}
    for sha256 in answer["extended_benches"].values():
        assert corrections(store, sha256)["sensor.winding.bias"] == pytest.approx(TOO_MUCH_K, abs=1.0)
    assert main(["accept", f"d-{answer['diagnosis'][:8]}", "--store", str(store)]) == 0
    now = {s.name: facts_of(store).bench_of(s) for s in facts_of(store).sessions}
    assert {one.sha256 for one in now.values() if one} == set(answer["extended_benches"].values())
    assert main(["verify", "--read", "--store", str(store)]) == 0


def test_a_correction_stands_in_no_bench_file_without_its_signal(tmp_path: Path, capsys: Capture) -> None:
    own = columns(but={"winding": None}) | {"T_Wickl": "winding"}
    store = ingested(tmp_path, {"1_a": columns(), "2_b": own, "3_c": columns()})
    answer = asked(store, capsys)
    assert answer["why_no_files"] is None
    files = {s.name: s.bench for s in facts_of(store).sessions}
    said = {one: corrections(store, answer["extended_benches"].get(sha, sha)) for one, sha in files.items() if sha}
    assert not any("TC_winding" in cause for cause in said["2_b"])
    assert not any("T_Wickl" in cause for one in ("1_a", "3_c") for cause in said[one])


def test_two_names_of_one_sensor_in_one_bench_file_are_learnt_from(tmp_path: Path, capsys: Capture) -> None:
    logs = {"1_a": columns(), "2_b": columns(but={"yoke": "T_Rücken"}), "3_c": columns()}
    (tmp_path / "motor.toml").write_text(can_bench.MOTOR, encoding="utf-8")
    (tmp_path / "bench.toml").write_text(bench(*logs.values()), encoding="utf-8")
    paths = [str(write_log(tmp_path, name, own)) for name, own in logs.items()]
    store = tmp_path / "store"
    assert main(["ingest", *paths, "--bench", str(tmp_path / "bench.toml"), "--store", str(store)]) == 0
    answer = asked(store, capsys)
    assert answer["why_no_files"] is None
    assert [cause["id"] for cause in answer["causes"]] == ["sensor.winding.bias"]


def test_tables_of_three_vocabularies_and_a_bus_log_are_diagnosed_together(tmp_path: Path, capsys: Capture) -> None:
    """One motor and four loggers, one of which reads the winding wrongly."""
    english, german = ("speed", "current", "T_inlet"), ("Drehzahl", "Strom", "T_Vorlauf")
    tables = {
        "1_a": (PLAIN, english, 0.0),
        "2_b": (OURS, german, TOO_MUCH_K),
        "3_c": (OURS, german, TOO_MUCH_K),
        "4_d": (THEIRS, ("giri", "I_fase", "T_acqua"), 0.0),
    }
    can_bench.write_files(tmp_path)
    can_bench.write_log(tmp_path / "5_e.blf", 600, seed=5, start=can_bench.START + 5 * 86_400.0, magnet_loss=90.0)
    logs = [[str(tmp_path / "5_e.blf"), "--bench", str(tmp_path / "bench.toml"), "--dbc", str(tmp_path / "bench.dbc")]]
    for name, (names, inputs, too_much_K) in tables.items():
        path = tmp_path / f"bench_{inputs[0]}.toml"
        path.write_text(bench(columns(names), inputs=inputs), encoding="utf-8")
        logs.append([str(write_log(tmp_path, name, columns(names), inputs, too_much_K)), "--bench", str(path)])
    for words in logs:
        assert main(["ingest", *words, "--store", str(tmp_path / "store")]) == 0
    on = ("diagnose", "--on", "1_a", "2_b", "4_d", "5_e", "--hold-out", "3_c")
    answer = asked(tmp_path / "store", capsys, words=on)
    (cause,) = answer["causes"]
    assert cause["id"] == "sensor.winding@T_Wickl.bias"
    assert cause["estimate"] == pytest.approx(TOO_MUCH_K, abs=1.0)
    assert cause["why_not_improved"].startswith("the kept session is too short to judge by: two stretches of ")
    assert answer["masked"] == [] and {gain["node"] for gain in answer["gain"]} == set(NODES)
    ((_, sha256),) = answer["extended_benches"].items()
    assert corrections(tmp_path / "store", sha256) == {"sensor.winding.bias": pytest.approx(TOO_MUCH_K, abs=1.0)}


def test_one_of_two_names_in_a_bench_file_is_called_by_its_signal(tmp_path: Path, capsys: Capture) -> None:
    own = columns() | {"T_Rücken": "yoke", "T_Wickl": "winding"}
    (tmp_path / "motor.toml").write_text(can_bench.MOTOR, encoding="utf-8")
    (tmp_path / "bench.toml").write_text(bench(own), encoding="utf-8")
    other = tmp_path / "other.csv"
    other.write_text("epoch_s,T_Rücken,T_Wickl\n1.7e9,20,20\n1.7000001e9,20.1,20\n", encoding="utf-8")
    paths = [str(write_log(tmp_path, name, columns())) for name in SESSIONS]
    words = ["ingest", *paths, str(other), "--bench", str(tmp_path / "bench.toml"), "--store", str(tmp_path / "store")]
    assert main(words) == 0
    answer = asked(tmp_path / "store", capsys)
    assert answer["why_no_files"] is None
    ((_, sha256),) = answer["extended_benches"].items()
    assert "sensor.winding@TC_winding.bias" in corrections(tmp_path / "store", sha256)


LATE_s = 6.0  # the stamps of the thermometers' logger


def write_two_loggers(folder: Path, name: str) -> list[str]:
    """The table of a session as two loggers write it, the thermometers' late, each file called by its session."""
    table = np.genfromtxt(write_log(folder, name, columns(), too_much_K=0.0), delimiter=",", names=True)
    paths = []
    for what, own, late_s in (("bench", INPUTS, 0.0), ("thermo", PLAIN, LATE_s)):
        path = folder / f"{name}_{what}.csv"
        values = np.column_stack([table["epoch_s"] + late_s, *(table[one] for one in own)])
        np.savetxt(path, values, "%.2f", ",", header=",".join(["epoch_s", *own]), comments="", encoding="utf-8")
        paths.append(str(path))
    return paths


@pytest.mark.parametrize("known", [True, False])
def test_a_clock_is_put_right_in_every_log_of_its_logger(tmp_path: Path, capsys: Capture, known: bool) -> None:
    (tmp_path / "motor.toml").write_text(can_bench.MOTOR, encoding="utf-8")
    logger = '[[logger]]\nname = "thermo"\nfiles = "*_Thermo.*"\n' if known else ""
    (tmp_path / "bench.toml").write_text(bench(columns()) + logger, encoding="utf-8")
    paths = [path for name in SESSIONS for path in write_two_loggers(tmp_path, name)]
    store = tmp_path / "store"
    assert main(["ingest", *paths, "--bench", str(tmp_path / "bench.toml"), "--store", str(store)]) == 0
    first, second, third = (session.name for session in facts_of(store).sessions)
    answer = asked(store, capsys, words=("diagnose", "--on", first, second, "--hold-out", third))
    clocks = ["thermo"] if known else [f"{name}_thermo" for name in SESSIONS]
    (cause,) = answer["causes"]
    assert cause["id"] == f"clock.{clocks[0]}.offset"
    assert cause["says"] == f"the stamps of {clocks[0]} are shifted in time"
    said = corrections(store, answer["extended_bench"])
    assert said == {f"clock.{clock}.offset": pytest.approx(LATE_s, abs=1.0) for clock in clocks}
    assert len(set(said.values())) == 1
