"""`whyhot lineage`: from a number to the bytes of the log, through every fact between."""

from __future__ import annotations

import json
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest
from jsonschema import Draft202012Validator, FormatChecker
from openlineage.client import facet_v2
from openlineage.client.event_v2 import InputDataset, Job, OutputDataset, Run, RunEvent, RunState
from openlineage.client.serde import Serde
from referencing import Registry, Resource

from made import can_bench
from replay.cli import main

Capture = pytest.CaptureFixture[str]


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("lineage")
    can_bench.write_files(folder)
    can_bench.write_log(folder / "1_s1.blf", seconds=60, seed=1)
    words = ["ingest", str(folder / "1_s1.blf"), "--bench", str(folder / "bench.toml")]
    assert main([*words, "--dbc", str(folder / "bench.dbc"), "--store", str(folder / "store")]) == 0
    assert main(["replay", "1_s1", "--store", str(folder / "store")]) == 0
    return folder / "store"


def ask(store: Path, capsys: Capture, *words: str) -> Any:
    capsys.readouterr()
    assert main([*words, "--store", str(store), "--json"]) == 0
    return json.loads(capsys.readouterr().out)


@pytest.mark.parametrize("topic", ["RawFileSealed", "SessionRecorded", "ReplayCompleted", "ModelPublished"])
def test_a_row_of_events_leads_where_what_it_is_about_does(topic: str, store: Path, capsys: Capture) -> None:
    sql = f"SELECT stream FROM events WHERE topic = 'whyhot:{topic}' LIMIT 1"
    (row,) = ask(store, capsys, "sql", sql)["rows"]
    found = ask(store, capsys, "lineage", sql)
    assert found["links"] == ask(store, capsys, "lineage", row["stream"].partition("-")[2])["links"]
    assert found["links"]


def test_a_row_of_residuals_leads_to_the_frame_that_holds_its_sample(store: Path, capsys: Capture) -> None:
    sql = "SELECT * FROM residuals WHERE channel = 'TC_magnet' AND t_s > 30 ORDER BY t_s LIMIT 1"
    (row,) = ask(store, capsys, "sql", sql)["rows"]
    found = ask(store, capsys, "lineage", sql)
    assert found == {**ask(store, capsys, "lineage", f"{row['run']}@{row['t_s']}/TC_magnet"), "what": sql}
    (point,) = found["points"]
    assert (point["residual_K"], point["first"], point["last"]) == (
        row["residual_K"],
        row["first_record"],
        row["last_record"],
    )
    kinds = [link["kind"] for link in found["links"]]
    assert kinds == ["replay", "motor file", "session", "bench file", "log", "decode", "signal database"]
    assert all(link["event"] and link["code"].startswith("whyhot ") for link in found["links"])
    assert found["links"][4]["id"] == row["file_id"]
    assert found["links"][4]["command"] == "whyhot ingest 1_s1.blf --bench bench.toml --dbc bench.dbc"
    assert found["links"][0]["command"].startswith(f"whyhot replay {row['session'][:12]} --model ")
    records = {one["record"]: one for one in found["records"]}
    assert set(records) == {row["first_record"], row["last_record"]}
    holds = [one["holds"] for one in records.values()]
    magnet = [int.from_bytes(bytes.fromhex(one.split(": ")[1])[4:6], "little") / 100 for one in holds]
    assert min(magnet) - 0.5 < row["measured_degC"] < max(magnet) + 0.5, "the DBC's bytes 4 and 5, in 0.01 degC"
    assert all(one["where"].startswith("byte ") for one in records.values())


def test_a_point_may_be_asked_for_by_the_name_of_the_session(
    store: Path, capsys: Capture, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (row,) = ask(store, capsys, "sql", "SELECT run FROM runs")["rows"]
    found = ask(store, capsys, "lineage", "1_s1@0:00:30/TC_magnet")
    assert found["points"] == ask(store, capsys, "lineage", f"{row['run']}@30/TC_magnet")["points"]
    monkeypatch.chdir(tmp_path)
    Path("a.csv").write_text("time,T\n0,20.0\n1,20.1\n", encoding="utf-8")
    assert main(["ingest", "a.csv", "--store", "s"]) == 0
    assert main(["lineage", "a@1/T", "--store", "s"]) == 2
    line = "session a: has no replay to take a point of: `whyhot replay --store s a` first."
    assert line in capsys.readouterr().err


def test_a_number_of_a_report_may_be_asked_for_by_the_name_or_id_of_the_session(store: Path, capsys: Capture) -> None:
    (row,) = ask(store, capsys, "sql", "SELECT run, session FROM runs")["rows"]
    points = ask(store, capsys, "lineage", f"{row['run']}/magnet")["points"]
    assert ask(store, capsys, "lineage", "1_s1/magnet")["points"] == points
    assert ask(store, capsys, "lineage", f"{row['session'][:8]}/TC_magnet")["points"] == points


def test_a_bench_file_leads_to_its_event(store: Path, capsys: Capture) -> None:
    (link,) = ask(store, capsys, "lineage", "bench.toml")["links"]
    assert (link["kind"], link["says"]) == ("bench file", "bench.toml")
    assert ask(store, capsys, "lineage", link["id"][:12])["links"] == [link]


def test_a_replay_leads_to_the_files_that_it_had_when_its_log_was_corrected_since(
    capsys: Capture, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    can_bench.write_files(tmp_path)
    can_bench.write_log(tmp_path / "1_s1.blf", seconds=60, seed=1)
    Path("other.toml").write_text(can_bench.BENCH.replace("[[channel]]", "[[channel]]\nbias_sd = 1.0", 1))
    store = tmp_path / "store"
    words = ["1_s1.blf", "--bench", "bench.toml", "--dbc", "bench.dbc", "--store", "store"]
    assert main(["ingest", *words]) == 0
    assert main(["replay", "1_s1", "--store", "store"]) == 0
    (row,) = ask(store, capsys, "sql", "SELECT run FROM runs")["rows"]
    before = ask(store, capsys, "lineage", row["run"])["links"]
    assert main(["correct", "1_s1", "--bench", "other.toml", "--reason", "bias", "--store", "store"]) == 0
    after = ask(store, capsys, "lineage", row["run"])["links"]
    assert [(one["kind"], one["id"], one["says"]) for one in after] == [
        (one["kind"], one["id"], one["says"]) for one in before
    ]
    now = [(one["kind"], one["says"]) for one in ask(store, capsys, "lineage", "1_s1")["links"]]
    assert now[1] == ("bench file", "other.toml") and ("correction", "bias") in now


def test_the_mean_error_of_a_report_is_that_of_the_steps_behind_it(store: Path, capsys: Capture) -> None:
    (run,) = ask(store, capsys, "sql", "SELECT run, summary->'mae_K'->>'magnet' AS mae FROM runs")["rows"]
    (point,) = ask(store, capsys, "lineage", f"{run['run'][:8]}/magnet")["points"]
    assert point["residual_K"] == pytest.approx(float(run["mae"]), rel=1e-9)
    assert point["steps"] > 50 and point["channel"] == "TC_magnet"


def test_a_sample_a_session_a_log_and_a_model_lead_to_what_they_came_from(store: Path, capsys: Capture) -> None:
    sample = ask(store, capsys, "lineage", "FROM samples WHERE channel = 'TC_yoke' LIMIT 1")
    assert [link["kind"] for link in sample["links"]] == ["log", "decode", "bench file", "signal database"]
    assert len(sample["records"]) == 1
    session = ask(store, capsys, "lineage", "1_s1")
    assert [link["kind"] for link in session["links"]][:2] == ["session", "bench file"]
    assert ask(store, capsys, "lineage", "1_s1.blf")["links"] == sample["links"]
    assert [one["record"] for one in ask(store, capsys, "lineage", "1_s1.blf:3-5")["records"]] == [3, 5]
    (model,) = ask(store, capsys, "lineage", "servo-5kW")["links"]
    assert model["kind"] == "motor file" and model["says"] == "motor.toml of servo-5kW"


def test_a_table_of_several_specimens_is_one_log(tmp_path: Path, capsys: Capture) -> None:
    (tmp_path / "t.csv").write_text(
        "time,T,who\n" + "".join(f"2026-02-01T08:0{k}:00Z,2{k},S{k // 4}\n" for k in range(8))
    )
    channel = '[[channel]]\nsignal = "T"\nquantity = "temperature"\nunit = "degC"\n'
    (tmp_path / "bench.toml").write_text('schema = "whyhot.bench/1"\nspecimen_column = "who"\n' + channel)
    store = tmp_path / "store"
    words = ["ingest", str(tmp_path / "t.csv"), "--bench", str(tmp_path / "bench.toml"), "--store", str(store)]
    assert main(words) == 0
    found = ask(store, capsys, "lineage", "FROM samples WHERE value = 26")
    assert (found["links"][0]["says"].split(", ")[2], found["records"][0]["record"]) == ("records 0 to 7", 6)


def test_a_record_of_one_of_two_logs_of_a_name_asks_which(tmp_path: Path, capsys: Capture) -> None:
    store = ["--store", str(tmp_path / "store")]
    for value in (20, 30):
        (tmp_path / "a.csv").write_text(f"time,T\n0,{value}\n1,{value + 1}\n")
        assert main(["ingest", str(tmp_path / "a.csv"), *store]) == 0
    capsys.readouterr()
    assert main(["lineage", "a.csv:1", *store]) == 2
    assert capsys.readouterr().err.startswith("a.csv: is more than one: log ")


def test_it_is_told_in_lines_that_a_person_reads(store: Path, capsys: Capture) -> None:
    assert main(["lineage", "1_s1.blf:3", "--store", str(store)]) == 0
    said = capsys.readouterr().out.splitlines()
    assert said[0].startswith("Log               1_s1.blf, ")
    assert any(line.startswith("Record 3          1_s1.blf, byte ") for line in said)


@pytest.mark.parametrize(
    ("what", "line"),
    [
        ("1_s1.blf:99999999", "1_s1.blf: has no record 99,999,999: it holds "),
        ("2_s1", "2_s1: is not in this store. Nearest: 1_s1"),
        ("1_s1@99:00:00/magnet", "replay "),
        ("SELECT 1 AS x", "the row has no column that says where it came from: select run"),
        ("SELECT * FROM runs WHERE run = 'no'", "SQL: gives no row: there is nothing to trace"),
    ],
)
def test_what_leads_nowhere_is_one_line(store: Path, capsys: Capture, what: str, line: str) -> None:
    capsys.readouterr()
    assert main(["lineage", what, "--store", str(store)]) == 2
    said = capsys.readouterr()
    assert (said.out, said.err.count("\n")) == ("", 1)
    assert said.err.startswith(line)


SCHEMAS = [json.loads(file.read_text("utf-8")) for file in (Path(__file__).parent / "openlineage").glob("*.json")]
PUBLISHED: Registry[Any] = Registry().with_resources((one["$id"], Resource.from_contents(one)) for one in SCHEMAS)
FORMATS = FormatChecker(["uuid"])  # and the two that jsonschema checks with other packages only


def is_a_time(said: object) -> bool:
    return datetime.fromisoformat(str(said)).tzinfo is not None


def is_an_address(said: object) -> bool:
    return bool(urlsplit(str(said)).scheme)


FORMATS.checks("date-time", raises=ValueError)(is_a_time)
FORMATS.checks("uri", raises=ValueError)(is_an_address)


def against(address: str, said: Any) -> list[str]:
    """What the published schema at this address has against what is said."""
    schema = {"$ref": address}
    return [
        f"{one.json_path}: {one.message}"
        for one in Draft202012Validator(schema, registry=PUBLISHED, format_checker=FORMATS).iter_errors(said)
    ]


def facets(said: Any) -> Iterator[dict[str, Any]]:
    """Every facet of an event, wherever it stands."""
    if isinstance(said, dict):
        yield from said.get("facets", {}).values()
    for one in said.values() if isinstance(said, dict) else said if isinstance(said, list) else ():
        yield from facets(one)


def published_schema_says(event: dict[str, Any]) -> list[str]:
    """What the schemas that an event and its facets name have against them."""
    return [
        *against(event["schemaURL"], event),
        *(line for one in facets(event) for line in against(one["_schemaURL"], one)),
    ]


FACETS = {  # key -> the type that the client of OpenLineage generates from its schema
    "processing_engine": facet_v2.processing_engine_run.ProcessingEngineRunFacet,
    "documentation": facet_v2.documentation_job.DocumentationJobFacet,
    "sourceCode": facet_v2.source_code_job.SourceCodeJobFacet,
    "version": facet_v2.dataset_version_dataset.DatasetVersionDatasetFacet,
}


def typed(event: dict[str, Any]) -> RunEvent:
    """The event as OpenLineage's own types; they refuse a field that its schema does not have, or that is missing."""

    def facets(said: dict[str, Any]) -> dict[str, Any]:
        plain = {name: {key: x for key, x in one.items() if key[0] != "_"} for name, one in said["facets"].items()}
        return {name: FACETS[name](**plain[name], producer=one["_producer"]) for name, one in said["facets"].items()}

    def datasets(kind: Any, said: list[dict[str, Any]]) -> list[Any]:
        return [kind(one["namespace"], one["name"], facets=facets(one)) for one in said]

    return RunEvent(
        eventType=RunState[event["eventType"]],
        eventTime=event["eventTime"],
        producer=event["producer"],
        run=Run(event["run"]["runId"], facets(event["run"])),
        job=Job(event["job"]["namespace"], event["job"]["name"], facets(event["job"])),
        inputs=datasets(InputDataset, event["inputs"]),
        outputs=datasets(OutputDataset, event["outputs"]),
    )


def without_empty(said: Any) -> Any:
    if isinstance(said, dict):
        return {name: without_empty(one) for name, one in said.items() if one != {}}
    return [without_empty(one) for one in said] if isinstance(said, list) else said


def test_open_lineage_is_as_its_own_client_would_write_it(store: Path, capsys: Capture) -> None:
    (run,) = ask(store, capsys, "sql", "SELECT run FROM runs")["rows"]
    assert main(["lineage", run["run"], "--openlineage", "--store", str(store)]) == 0
    decoded, replayed = (json.loads(line) for line in capsys.readouterr().out.splitlines())
    for event in (decoded, replayed):
        assert without_empty(Serde.to_dict(typed(event))) == event
        assert published_schema_says(event) == []
    assert [one["name"] for one in decoded["inputs"]] == [
        "log/1_s1.blf",
        "signal database/bench.dbc",
        "bench file/bench.toml",
    ]
    assert decoded["outputs"] == [one for one in replayed["inputs"] if one["name"].startswith("samples/")]
    assert replayed["inputs"][0]["name"] == "motor file/motor.toml"
    assert replayed["job"]["facets"]["sourceCode"]["sourceCode"].startswith("whyhot replay ")
    assert replayed["outputs"][0]["facets"]["version"]["datasetVersion"] == run["run"]


def test_open_lineage_of_a_session_a_log_and_a_model_says_what_each_was_made_of(store: Path, capsys: Capture) -> None:
    for what, jobs in (("1_s1", ["decode", "session"]), ("1_s1.blf", ["decode"]), ("servo-5kW", ["motor file"])):
        assert main(["lineage", what, "--openlineage", "--store", str(store)]) == 0
        events = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
        assert [one["job"]["name"] for one in events] == jobs
        assert all(without_empty(Serde.to_dict(typed(one))) == one for one in events)
        assert [line for one in events for line in published_schema_says(one)] == []


@pytest.mark.parametrize(
    ("place", "value", "line"),
    [
        (("eventTime",), "yesterday", "$.eventTime: 'yesterday' is not a 'date-time'"),
        (("run", "runId"), "7", "$.run.runId: '7' is not a 'uuid'"),
        (("job", "name"), None, "$.job.name: None is not of type 'string'"),
        (("outputs", 0, "facets", "version", "datasetVersion"), 3, "$.datasetVersion: 3 is not of type 'string'"),
    ],
)
def test_the_published_schema_would_tell(
    store: Path, capsys: Capture, place: tuple[str | int, ...], value: object, line: str
) -> None:
    capsys.readouterr()
    assert main(["lineage", "1_s1.blf", "--openlineage", "--store", str(store)]) == 0
    event = changed = json.loads(capsys.readouterr().out)
    for key in place[:-1]:
        changed = changed[key]
    changed[place[-1]] = value
    assert published_schema_says(event) == [line]
