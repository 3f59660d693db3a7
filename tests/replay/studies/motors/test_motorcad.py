"""Thermal matrices and loss maps as Motor-CAD exports them, made into motor files and maps."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.io import savemat

from replay.cli import main
from replay.engine.files.motor_file import read_motor
from replay.engine.files.motor_maps import whole
from replay.errors import MotorFileError
from replay.studies.motors import loss_tables
from replay.studies.motors.motorcad import motor_of
from replay.studies.motors.motorcad_maps import maps_of
from twin.motor.network import Map, Network

# 0 ambient, 1 inlet of the jacket, 2 and 3 fluid, 4 housing, 5 interface without mass, 6 winding, 7 winding again
NODES = (
    "Ambient",
    "WJ Inlet",
    "WJ Fluid [F]",
    "WJ Fluid [R]",
    "Housing [Active]",
    "Interface (1)",
    "Winding",
    "Winding",
)
CAPACITY = (None, 0.0, 0.0, 35.5, 4200.0, 0.0, 900.0, 450.0)
LOSS = (None, 0.0, 0.0, 0.0, 120.0, 30.0, 800.0, 0.0)
FIXED = (20.0, 65.0, -1e7, -1e7, -1e7, -1e7, -1e7, -1e7)
LINKS = {(0, 4): 2.5, (2, 4): 0.02, (3, 4): 0.025, (4, 5): 0.04, (5, 6): 0.05, (5, 7): 0.08, (6, 7): 0.5}
STREAM = {(1, 2): 0.0021, (2, 3): 0.0021}  # upstream, downstream: 1 / (rho cp V)


def resistances(links: dict[tuple[int, int], float], stream: dict[tuple[int, int], float]) -> NDArray[np.float64]:
    table = np.full((len(NODES), len(NODES)), 1e9)
    for (a, b), value in links.items():
        table[a, b] = table[b, a] = value
    for (up, down), value in stream.items():
        table[down, up] = value
    return table


def write(
    folder: Path,
    table: NDArray[np.float64],
    fixed: Sequence[float] = FIXED,
    capacity: Sequence[float | None] = CAPACITY,
) -> Path:
    """The five files, as the public readers expect them."""
    labels = [f"{i} ({name})" for i, name in enumerate(NODES)]
    for end, values in ((".cmf", capacity), (".pmf", LOSS), (".tmf", fixed)):
        rows = [f"{label};{value!r};" for label, value in zip(labels, values, strict=True) if value is not None]
        (folder / f"e8 motor{end}").write_text("\n".join(["Motor-CAD", str(len(rows)), "", *rows, ""]))
    rows = [";".join([label, *(f"{value:.9g}" for value in row), ""]) for label, row in zip(labels, table, strict=True)]
    (folder / "e8 motor.rmf").write_text("\n".join(["Motor-CAD", "8", "", ";".join(["", *labels, ""]), *rows, ""]))
    groups = ["[Ambient]", labels[0], "", "[Housing Water Jacket]", *labels[1:4], "", "[Solids]", *labels[4:]]
    (folder / "e8 motor.nmf").write_text("\n".join(["Motor-CAD", "8", "", *groups, ""]))
    return folder / "e8 motor.rmf"


def steady(g: NDArray[np.float64], heat: NDArray[np.float64], fixed: dict[int, float]) -> NDArray[np.float64]:
    """Temperatures [degC] where row i of `g` (N, N) [W/K] brings heat from the others to node i."""
    a, b = np.diag(g.sum(axis=1)) - g, heat.copy()
    for node, degC in fixed.items():
        a[node], b[node] = np.eye(len(g))[node], degC
    return np.asarray(np.linalg.solve(a, b), np.float64)


def conductances(network: Network) -> tuple[list[str], NDArray[np.float64], NDArray[np.float64]]:
    names = [*(one.name for one in network.boundaries), *(one.name for one in network.nodes)]
    g, heat = np.zeros((len(names), len(names))), np.zeros(len(names))
    for link in network.links:
        a, b = names.index(link.a), names.index(link.b)
        g[a, b] = g[b, a] = link.terms[0].coefficient
    for source in network.sources:
        heat[names.index(source.node)] = source.terms[0].coefficient
    for circuit in network.circuits:
        w_per_K = circuit.fluid.density.value[0] * circuit.fluid.heat_capacity.value[0] * 8.0 / 60_000
        for up, down in zip((circuit.inlet, *circuit.nodes), circuit.nodes, strict=False):
            g[names.index(down), names.index(up)] = w_per_K
    return names, g, heat


@pytest.mark.parametrize("transposed", [False, True], ids=["2025 R1 and newer", "before"])
def test_the_motor_file_has_the_temperatures_of_the_matrices(tmp_path: Path, transposed: bool) -> None:
    table = resistances(LINKS, STREAM)
    path = write(tmp_path, table.T if transposed else table)
    network = read_motor(motor_of(path, [8.0]).encode(), "motor.toml")
    assert network.name == "e8-motor" and [one.name for one in network.boundaries] == ["ambient", "wj_inlet"]
    assert {one.name: one.capacity for one in network.nodes} == {
        "wj_fluid_f": 1.0,  # has none there
        "wj_fluid_r": 35.5,
        "housing_active": 4200.0,
        "winding": 900.0,
        "winding_2": 450.0,
    }
    assert [(one.name, one.nodes, one.flow) for one in network.circuits] == [
        ("housing_water_jacket", ("wj_fluid_f", "wj_fluid_r"), "flow")
    ]
    g = np.where((table < 1e8) & ~np.eye(8, dtype=bool), 1 / table, 0.0)
    theirs = steady(g, np.array([value or 0.0 for value in LOSS]), {0: 20.0, 1: 65.0})
    names, own, heat = conductances(network)
    ours = dict(zip(names, steady(own, heat, {0: 20.0, 1: 65.0}), strict=True))
    places = {"wj_fluid_f": 2, "wj_fluid_r": 3, "housing_active": 4, "winding": 6, "winding_2": 7}
    np.testing.assert_allclose([ours[name] for name in places], theirs[list(places.values())], atol=1e-3)


@pytest.mark.parametrize(
    ("links", "stream", "flows", "says"),
    [
        (LINKS, STREAM, [], "fluid flows through housing_water_jacket, and .* with --flow-lpm"),
        (LINKS, {}, [8.0], "no fluid flows through its nodes: take --flow-lpm away"),
        (LINKS, STREAM | {(2, 5): 0.002}, [8.0], "the flow from wj_inlet splits or comes together"),
        (LINKS, {(2, 3): 0.002}, [8.0], "nothing says where the fluid of wj_fluid_f comes from"),
        (LINKS | {(0, 6): -1.0}, STREAM, [8.0], "holds resistances of 0 or below"),
    ],
)
def test_what_no_motor_file_says_is_refused(
    tmp_path: Path,
    links: dict[tuple[int, int], float],
    stream: dict[tuple[int, int], float],
    flows: list[float],
    says: str,
) -> None:
    with pytest.raises(MotorFileError, match=says):
        motor_of(write(tmp_path, resistances(links, stream)), flows)


def test_files_that_are_missing_or_damaged_are_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write(tmp_path, resistances(LINKS, STREAM))
    for end, text, says in (
        (".cmf", "Motor-CAD\n8\n", 'e8 motor.cmf: holds no lines as "12 (Housing);345.6"'),
        (".pmf", "1 (WJ Inlet);none;\n", 'e8 motor.pmf: "none" is not a number'),
        (".rmf", "0 (Ambient);1;2\n", "e8 motor.rmf: holds 0 rows of 8 nodes"),
        (".tmf", None, "e8 motor.tmf: cannot be read"),
    ):
        kept = path.with_suffix(end).read_text()
        path.with_suffix(end).unlink() if text is None else path.with_suffix(end).write_text(text)
        assert main(["motor", "import", str(path), "--flow-lpm", "8", "-o", str(tmp_path / "m.toml")]) == 2
        line = capsys.readouterr().err
        assert says in line and line.count("\n") == 1
        path.with_suffix(end).write_text(kept)
    assert main(["motor", "import", str(path), "--flow-lpm", "8", "-o", str(tmp_path / "m.toml")]) == 0
    assert "5 nodes, 6 links" in capsys.readouterr().out
    assert main(["motor", "check", str(tmp_path / "m.toml")]) == 0


MOTOR = """
name = "m"
scale = {speed_rpm = 1.0, torque_Nm = 1.0}
[[node]]
name = "teeth"
capacity = 1.0
[[boundary]]
name = "air"
[[link]]
between = ["teeth", "air"]
terms = [{coefficient = 1.0}]
[[source]]
node = "teeth"
terms = [{coefficient = 1.0, map = "maps/iron_loss_stator_tooth.csv"}]
"""


def efficiency_map() -> dict[str, NDArray[np.float64]]:
    """Speeds in rows, torques that reach less far at higher ones, and losses that are linear in both."""
    speed = np.repeat(np.arange(500.0, 10_001, 500)[:, None], 12, axis=1)
    torque = np.linspace(0, 1, 12) * np.minimum(300, 900_000 / speed)
    return {
        "Speed": speed,
        "Shaft_Torque": torque,
        "Iron_Loss_Stator_Tooth": 10 + speed / 50 + torque,
        "Magnet_Loss": np.zeros_like(speed),
        "Efficiency": 90 + 0 * speed,
    }


def test_a_map_of_losses_has_their_values_where_the_motor_reaches(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, held = tmp_path / "MotorLAB_elecdata.mat", efficiency_map()
    generating = {name: np.hstack([values, values[:, 1:]]) for name, values in held.items()}
    generating["Shaft_Torque"][:, 12:] *= -1
    generating["Iron_Loss_Stator_Tooth"][:, 12:] += 500
    savemat(path, generating)
    assert main(["motor", "import", str(path), "-o", str(tmp_path / "maps")]) == 0
    assert "1 maps: iron_loss_stator_tooth" in capsys.readouterr().out
    motor = tmp_path / "motor.toml"
    motor.write_text(MOTOR)
    table = read_motor(whole(motor), motor.name).sources[0].terms[0].shape
    assert isinstance(table, Map)
    speed, torque, loss = np.array(table.speed), np.array(table.load), np.array(table.values)
    reached = np.abs(torque) <= np.minimum(300, 900_000 / speed)[:, None] * 0.98
    driving, braking = reached & (torque >= 0), reached & (torque < -30)
    expected = 10 + speed[:, None] / 50 + np.abs(torque)
    np.testing.assert_allclose(loss[driving], expected[driving], rtol=1e-3)
    np.testing.assert_allclose(loss[braking], 500 + expected[braking], rtol=1e-3)
    beyond = loss[~reached & (torque > 250)]  # the nearest point that it reaches
    assert min(driving.sum(), braking.sum()) > 100 and beyond.size and beyond.max() <= 10 + 10_000 / 50 + 300


@pytest.mark.parametrize(
    ("held", "says"),
    [
        ({name: values[:, -1:] for name, values in efficiency_map().items()}, "holds a curve and no map"),
        ({"Speed": np.ones((2, 2))}, "holds no Shaft_Torque"),
        ({"Id_Peak": np.ones((2, 2)), "Iq_Peak": np.ones((2, 2))}, "over currents and not over speed and torque"),
        (efficiency_map() | {"Magnet_Loss": np.ones((2, 2))}, "Magnet_Loss is no whole matrix"),
    ],
    ids=["a curve", "no torque", "over currents", "another size"],
)
def test_a_file_without_a_map_is_refused(tmp_path: Path, held: dict[str, NDArray[np.float64]], says: str) -> None:
    savemat(tmp_path / "a.mat", held)
    with pytest.raises(MotorFileError, match=says):
        maps_of(tmp_path / "a.mat")


def test_bytes_that_are_no_matlab_file_are_refused(tmp_path: Path) -> None:
    for data in (b"", b"x" * 300, b"MATLAB 5.0 MAT-file".ljust(124) + b"\0\1IM" + b"\xff" * 60):
        (tmp_path / "a.mat").write_bytes(data)
        with pytest.raises(MotorFileError, match=r"a\.mat: "):
            maps_of(tmp_path / "a.mat")


def test_a_table_of_operating_points_becomes_maps_whatever_it_calls_its_columns(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """German, with a line above the names and units below them; points without a value are left out."""
    rows = "".join(
        f"{speed};{torque};{f'{(10 + speed / 50 + torque) / 1000:.6f}'.replace('.', ',')};{speed * torque}\n"
        for speed in range(0, 10_001, 1000)
        for torque in range(-50, 301, 50)
    )
    text = f"Kennfeld;e8\nDrehzahl;Drehmoment;Eisenverluste;Leistung\n1/min;Nm;kW;W\n{rows}5000;100;;0\n"
    path = tmp_path / "e8.csv"
    path.write_text(text, encoding="cp1252")
    assert main(["motor", "import", str(path), "-o", str(tmp_path / "maps")]) == 0
    assert "1 maps: eisenverluste" in capsys.readouterr().out
    motor = tmp_path / "motor.toml"
    motor.write_text(MOTOR.replace("iron_loss_stator_tooth", "eisenverluste"))
    table = read_motor(whole(motor), motor.name).sources[0].terms[0].shape
    assert isinstance(table, Map)
    assert (table.speed[-1], table.load[0], table.load[-1]) == (10_000, -50, 300)
    expected = 10 + np.array(table.speed)[:, None] / 50 + np.array(table.load)
    np.testing.assert_allclose(np.array(table.values), expected, rtol=1e-4)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("Speed [rpm],Torque [Nm],P [W]\n0,0,1\n1,1,2\n", "no column of it is called a loss"),
        ("Speed,Torque [Nm],Loss [W]\n0,0,1\n1,1,2\n", '"Speed" says no unit'),
        ("Speed [rpm],n [rpm],Loss [W]\n0,0,1\n1,1,2\n", "n .rpm. seem to be the speed"),
        ("Speed [rpm],Torque [Nm],Loss [Nm]\n0,0,1\n1,1,2\n", 'column "Loss .Nm."'),
        ("Speed [rpm],Torque [Nm],Loss [W]\n0,0,1\n1,1,2\n2,2,3\n", "its points lie on a line"),
        ("all well\n", "holds one line"),
    ],
)
def test_a_table_that_is_no_map_is_refused(tmp_path: Path, text: str, says: str) -> None:
    path = tmp_path / "a.csv"
    path.write_text(text)
    with pytest.raises(MotorFileError, match=rf"a\.csv.*{says}"):
        loss_tables.maps_of(path)
