"""`whyhot motor`: new, scale, slice, plot and reduce, as a person types them."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest

from made import can_bench
from made.browser import label_faults
from made.places import EXAMPLES
from replay.cli import main
from replay.engine.files.motor_file import read_motor
from replay.show.verbs.reduction import reduction_text
from replay.studies.motors.new import TOPOLOGIES
from twin.motor.check import check

REFERENCE = EXAMPLES / "reference_motor" / "motor.toml"
SLICED = REFERENCE.with_name("sliced.toml")


def _run(capsys: pytest.CaptureFixture[str], *words: str | Path, code: int = 0) -> dict[str, Any]:
    capsys.readouterr()
    assert main(["motor", *map(str, words), "--json"]) == code
    answer: dict[str, Any] = json.loads(capsys.readouterr().out)
    return answer


def _refused(capsys: pytest.CaptureFixture[str], *words: str | Path) -> str:
    """The one line that a wrong command gets."""
    capsys.readouterr()
    try:
        assert main(["motor", *map(str, words)]) == 2
    except SystemExit as left:
        assert left.code == 2
    line = capsys.readouterr().err
    assert line.count("\n") == 1
    return line


@pytest.mark.parametrize("topology", TOPOLOGIES)
def test_a_new_motor_file_passes_the_check_and_explains_every_part(
    topology: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "motor.toml"
    answer = _run(capsys, "new", "--topology", topology, "-o", file)
    found = _run(capsys, "check", file)
    assert (answer["topology"], answer["nodes"]) == (topology, found["nodes"])
    assert found["warnings"] == []
    text = file.read_text(encoding="utf-8")
    assert "order of magnitude" in text.replace("\n# ", " ")
    assert text.count("#") > 15
    assert text.count("sd = ") == found["unknowns"], "every number says how well it is known"
    assert max(map(len, text.splitlines())) <= 130


def test_without_a_topology_it_is_the_one_with_a_water_jacket(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert _run(capsys, "new", "-o", tmp_path / "motor.toml")["nodes"] == 21


def test_a_file_that_is_there_is_never_written_over(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "motor.toml"
    file.write_text("mine")
    assert re.search(r"motor\.toml: is there already: give another name with -o", _refused(capsys, "new", "-o", file))
    assert file.read_text() == "mine"


def test_a_scaled_file_keeps_comments_and_layout_and_says_what_it_came_from(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "small.toml"
    answer = _run(capsys, "scale", REFERENCE, "--length", "0.8", "-o", file)
    assert answer["motor"] == "reference-150kW_x0.8"
    assert answer["scale"] == {"speed": 16000.0, "current": 360.0, "flow": 6.4}
    text, before = file.read_text(encoding="utf-8"), REFERENCE.read_text(encoding="utf-8")
    comments = [line.partition("#")[2] for line in before.splitlines() if "#" in line]
    assert not [comment for comment in comments if comment not in text]
    assert "# Scaled from reference-150kW: every length times 0.8" in text
    assert "capacity = 624.64              # 2.6 kg of steel" in text
    network = read_motor(text.encode(), "small.toml")
    check(network)
    assert network.links[4].terms[0].sd > 0.4


def test_the_shipped_motor_of_several_hundred_nodes_is_what_its_own_comment_makes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = SLICED.read_text(encoding="utf-8")
    command = re.sub(r"\n# +", " ", text[: text.index("-o ")]).split("`")[-1].split()
    assert command[:4] == ["whyhot", "motor", "slice", "motor.toml"]
    file = tmp_path / "sliced.toml"
    _run(capsys, "slice", REFERENCE, *command[4:], "-o", file)
    assert file.read_bytes() == SLICED.read_bytes()
    found = _run(capsys, "check", file)
    assert (found["nodes"], found["kernel"]) == (293, "indexed")
    assert found["capacity_J_per_K"] == pytest.approx(_run(capsys, "check", REFERENCE)["capacity_J_per_K"], rel=1e-6)


def test_the_shipped_motor_of_several_hundred_nodes_replays_a_session_of_the_lumped_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    example, store = REFERENCE.parents[1] / "hidden_effect", str(tmp_path / "store")
    words = ["--bench", str(example / "bench.toml"), "--dbc", str(example / "bench.dbc"), "--store", store]
    assert main(["ingest", str(example / "1_s1.blf"), *words]) == 0
    capsys.readouterr()
    assert main(["replay", "1_s1", "--model", str(SLICED), "--json", "--store", store]) == 0
    (run,) = json.loads(capsys.readouterr().out)["runs"]
    assert run["motor"] == "reference-150kW_40_slices"
    assert {"endwinding_a_inner", "magnet", "teeth", "yoke"} <= set(run["mae_K"])
    assert all(0.0 < error < 40.0 for error in run["mae_K"].values())
    made = run["losses"]["kinds"].values()
    assert sum(one["mean_W"] for one in made) == pytest.approx(run["network_heat_W"])
    assert run["hot_spots"]["magnet"]["node"].startswith("magnet")


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["check"], "check needs FILE"),
        (["new"], "new needs -o OUT"),
        (["scale", "m.toml", "-o", "x.toml"], "scale needs --length"),
        (["slice", "m.toml", "--into", "4", "-o", "x.toml"], "slice needs --stack-mm"),
        (["reduce", "m.toml", "--to", "4", "-o", "x.toml"], "reduce needs --on"),
        (["check", "m.toml", "--to", "4"], "check takes no --to"),
        (["new", "m.toml", "-o", "x.toml"], "new takes no FILE"),
        (["plot", "m.toml", "--hold-out", "a", "-o", "x.svg"], "plot takes no --hold-out"),
        (["plot", "m.toml", "-o", "x.png"], "plot writes an SVG: end -o x.png in .svg"),
        (["check", "lost.toml"], "lost.toml: "),
        (["scale", str(REFERENCE), "--length", "40", "-o", "x.toml"], "length 40 times is no motor of the same kind"),
        (
            ["slice", str(REFERENCE), "--into", "4", "--stack-mm", "9", "--nodes", "yok", "-o", "x.toml"],
            'node "yok": reference-150kW has no such node: did you mean "yoke"?',
        ),
        (["plot", str(REFERENCE), "--at", "speed=4", "-o", "x.svg"], "--at speed=4: say it as KEY=NUMBER; keys of"),
        (["plot", str(REFERENCE), "--at", "speed_rpm=fast", "-o", "x.svg"], "--at speed_rpm=fast: say it as"),
        (["plot", str(REFERENCE), "--at", "speed_rpm=nan", "-o", "x.svg"], "--at speed_rpm=nan: say it as"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(words: list[str], says: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert says in _refused(capsys, *words)
    assert not Path("x.toml").exists() and not Path("x.svg").exists()


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two sessions of a servo motor in a store, and its motor cut into 8 slices."""
    folder = tmp_path_factory.mktemp("reduce")
    can_bench.write_files(folder)
    can_bench.write_log(folder / "1_learn.blf", seconds=600, seed=1, magnet_loss=90.0)
    can_bench.write_log(folder / "2_kept.blf", 300, 2, can_bench.START + 86_400, magnet_loss=90.0)
    logs = [str(folder / name) for name in ("1_learn.blf", "2_kept.blf")]
    words = ["ingest", *logs, "--bench", str(folder / "bench.toml"), "--dbc", str(folder / "bench.dbc")]
    assert main([*words, "--store", str(folder / "store")]) == 0
    cut = ["--into", "8", "--stack-mm", "60", "--nodes", "winding", "yoke", "magnet", "-o", str(folder / "sliced.toml")]
    assert main(["motor", "slice", str(folder / "motor.toml"), *cut]) == 0
    return folder


def test_a_sliced_motor_is_reduced_by_recorded_sessions(bench: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words: list[str | Path] = ["reduce", bench / "sliced.toml", "--to", "6", "--on", "1_learn", "--hold-out", "2_kept"]
    files: list[str | Path] = ["--curve", bench / "curve.svg", "-o", bench / "six.toml", "--store", bench / "store"]
    answer = _run(capsys, *words, *files)
    assert answer["schema"] == "whyhot.motor_reduce/1"
    sizes = [level["nodes"] for level in answer["curve"]]
    assert sizes == list(range(24, 2, -1)), "down to the three measured nodes"
    assert answer["curve"][0]["trained"]["largest_K"] < 1e-6
    at = answer["curve"][sizes.index(6)]
    assert 0 <= at["kept"]["mean_K"] < 0.5
    assert {"winding", "yoke", "magnet"} <= set(answer["groups"])
    assert {node for node, why in answer["interest"].items() if why.startswith("measured")} == {
        "winding",
        "yoke",
        "magnet",
    }
    text = (bench / "six.toml").read_text(encoding="utf-8")
    network = read_motor(text.encode(), "six.toml")
    assert {node.name for node in network.nodes} == set(answer["groups"])
    assert network.name == "servo-5kW_8_slices_6_nodes"
    assert "# Nodes that stand for others:" in text and re.search(r"_\d+ to _\d+", text)
    assert label_faults(bench / "curve.svg") == []
    lines = reduction_text(answer).splitlines()
    assert max(map(len, lines)) <= 100
    (written,) = [line for line in lines if line.endswith("<- written")]
    assert written.split()[0] == "6"
    assert main(["replay", "2_kept", "--model", str(bench / "six.toml"), "--store", str(bench / "store")]) == 0


def test_without_a_number_the_fewest_nodes_are_written_that_kept_sessions_allow(
    bench: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("replay.studies.motors.reduce.ENOUGH_K", 0.04)
    words: list[str | Path] = ["reduce", bench / "sliced.toml", "--on", "1_learn", "--hold-out", "2_kept"]
    answer = _run(capsys, *words, "-o", bench / "enough.toml", "--store", bench / "store")
    errors = {level["nodes"]: level["kept"]["mean_K"] for level in answer["curve"]}
    assert answer["within_K"] == 0.04
    assert answer["nodes"] == min(nodes for nodes, error in errors.items() if error <= 0.04) == len(answer["groups"])
    assert max(errors.values()) > 0.04, "fewer nodes would be too few"
    assert len(read_motor((bench / "enough.toml").read_bytes(), "enough.toml").nodes) == answer["nodes"]
    assert f"{answer['nodes']} nodes are the fewest within 0.04 K" in reduction_text(answer)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (
            ["--on", "1_learn"],
            "is chosen by the error on kept sessions: name some with --hold-out, or a number with --to.",
        ),
        (["--to", "24", "--on", "1_learn"], "--to 24: servo-5kW_8_slices has 24 nodes: give a number from 1 to 23."),
        (["--to", "0", "--on", "1_learn"], "--to 0: servo-5kW_8_slices has 24 nodes"),
        (
            ["--to", "4", "--on", "1_learn", "--hold-out", "1_learn"],
            "session 1_learn is both in --on and in --hold-out",
        ),
        (["--to", "4", "--on", "3_lost"], "session '3_lost': is not in this store."),
    ],
)
def test_a_reduction_that_cannot_be_is_refused_in_one_line(
    bench: Path, words: list[str], says: str, capsys: pytest.CaptureFixture[str]
) -> None:
    line = _refused(capsys, "reduce", bench / "sliced.toml", *words, "-o", bench / "x.toml", "--store", bench / "store")
    assert says in line
    assert not (bench / "x.toml").exists()


RIGS = """\
[[boundary]]
name = "air"
[[configuration]]
name = "no_rotor"
remove = ["magnet"]
[[configuration.link]]
between = ["yoke", "air"]
terms = [{coefficient = 2.0, law = "free_convection"}]
"""


def test_configurations_go_along_when_a_motor_is_sliced_and_reduced(
    bench: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "motor.toml").write_text(can_bench.MOTOR + RIGS, encoding="utf-8")
    cut = ["--into", "4", "--stack-mm", "60", "--nodes", "winding", "yoke", "magnet"]
    _run(capsys, "slice", tmp_path / "motor.toml", *cut, "-o", tmp_path / "sliced.toml")
    (sliced,) = _run(capsys, "check", tmp_path / "sliced.toml")["configurations"]
    assert sliced.startswith("no_rotor: 8 nodes, 2 boundaries, ")
    words: list[str | Path] = [
        "reduce",
        tmp_path / "sliced.toml",
        "--to",
        "4",
        "--on",
        "1_learn",
        "--store",
        bench / "store",
    ]
    answer = _run(capsys, *words, "-o", tmp_path / "four.toml")
    assert all(len({member.split("_")[0] for member in members}) == 1 for members in answer["groups"].values())
    (reduced,) = _run(capsys, "check", tmp_path / "four.toml")["configurations"]
    rotor = [name for name in answer["groups"] if name.startswith("magnet")]
    assert reduced.startswith(f"no_rotor: {4 - len(rotor)} nodes, 2 boundaries, ")
    assert "Left out" not in (tmp_path / "four.toml").read_text(encoding="utf-8")
