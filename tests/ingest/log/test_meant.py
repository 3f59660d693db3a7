"""Identifiers that two databases explain otherwise: which message is meant on which bus, and what is said of it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from ingest.log.databases import Database, load
from ingest.log.meant import on_bus, untold
from replay.cli import main

DBC = """VERSION ""
NS_ :
BS_:
BU_: E
BO_ 256 {name}: 2 E
 SG_ {signal} : 0|16@1- ({factor},0) [0|0] "degC" E
BO_ 257 Common: 1 E
 SG_ Alive : 0|8@1+ (1,0) [0|0] "" E
"""
INVERTER = DBC.format(name="Inv", signal="T_igbt", factor=0.1)
BATTERY = DBC.format(name="Bms", signal="T_cell", factor=0.01)
SEEN = {(1, 256), (2, 256), (1, 257), (2, 257), (2, 999)}
BENCH = """schema = "whyhot.bench/1"
[[channel]]
signal = "can1:Inv.T_igbt"
quantity = "temperature"
unit = "degC"
node = "igbt"
[[channel]]
signal = "can2:Bms.T_cell"
quantity = "temperature"
unit = "degC"
node = "cell"
"""


def databases(*texts: str) -> list[Database]:
    return [load(text.encode(), f"{name}.dbc") for name, text in zip(("inv", "bms"), texts, strict=True)]


def test_the_bench_file_tells_by_bus_and_message() -> None:
    both = databases(INVERTER, BATTERY)
    names = {"can1:Inv.T_igbt", "can2:Bms.T_cell", "Common.Alive"}
    assert {place: message.name for place, message in on_bus(both, SEEN, names).items()} == {
        (1, 256): "Inv",
        (2, 256): "Bms",
    }
    assert untold(both, SEEN, names) is None


def test_what_nothing_tells_is_said_with_what_to_do() -> None:
    both = databases(INVERTER, BATTERY)
    assert on_bus(both, SEEN, ()) == {}
    assert untold(both, SEEN, {"can1:Inv.T_igbt"}) == (
        "can2:0x100 is read as Inv of inv.dbc, and not as Bms of bms.dbc: where it is the other, name its signals in "
        'the bench file as "can2:Bms.T_cell"'
    )
    assert untold(both, {(1, 257), (2, 999)}, ()) is None  # alike in both, and in neither


def test_two_versions_of_a_database_cannot_both_be_meant() -> None:
    says = untold(databases(INVERTER, INVERTER.replace("0.1", "0.2")), SEEN, ())
    assert says is not None and says.endswith(": give only the databases of this log")


def test_of_many_the_first_are_said() -> None:
    says = untold(databases(INVERTER, BATTERY), {(bus, 256) for bus in range(1, 6)}, ())
    assert says is not None and "; and 2 more: where" in says


def test_two_buses_with_a_database_each_are_decoded_as_the_bench_file_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    for name, text in (("inv.dbc", INVERTER), ("bms.dbc", BATTERY), ("bench.toml", BENCH)):
        Path(name).write_text(text, encoding="utf-8")
    lines = (f"({1_760_000_000 + i}.0) can{bus} 100#{2000 + i:04X}" for i in range(5) for bus in (1, 2))
    Path("two.log").write_text("\n".join(lines) + "\n", encoding="utf-8")
    both = ("--dbc", "inv.dbc", "--dbc", "bms.dbc")
    for words in (["inspect", "two.log"], ["ingest", "two.log", "--store", "open"]):
        assert main([*words, *both]) == 0
        assert "can2:0x100 is read as Inv of inv.dbc, and not as Bms of bms.dbc" in capsys.readouterr().out
    assert main(["show", "two", "--store", "open"]) == 0
    assert "can2:0x100 is read as Inv" in " ".join(capsys.readouterr().out.split())
    assert main(["ingest", "two.log", *both, "--bench", "bench.toml", "--store", "open"]) == 0
    assert "0x100" not in capsys.readouterr().out
    assert main(["show", "two", "--store", "open"]) == 0  # as it is decoded now
    assert "0x100" not in capsys.readouterr().out
    assert main(["show", "two", "--store", "open", "--json"]) == 0
    assert {one["name"] for one in json.loads(capsys.readouterr().out)["channels"]} >= {"T_igbt", "T_cell"}
