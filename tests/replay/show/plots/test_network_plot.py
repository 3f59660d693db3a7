from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from made.browser import label_faults
from made.places import EXAMPLES
from replay.engine.files.motor_file import read_motor
from replay.show.plots import network_plot
from replay.show.plots.network_places import places_of_boxes
from replay.show.plots.network_plot import draw_network, operating_point
from replay.show.words.figure import style
from twin.motor.network import Fluid, FluidCircuit, Network, Node, Property
from twin.motor.slicing import sliced


@pytest.fixture(scope="module")
def reference() -> Network:
    return read_motor((EXAMPLES / "reference_motor" / "motor.toml").read_bytes(), "motor.toml")


def _svg(network: Network, folder: Path, *said: str) -> str:
    file = folder / f"{network.name}.svg"
    draw_network(network, operating_point(network, said), file)
    return file.read_text(encoding="utf-8")


def _placed(network: Network) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Centres and sizes of the names."""
    sizes = network_plot._sizes(network, operating_point(network, ()))
    with style("test"):
        box = np.array([network_plot._box(name, sizes) for name in network.names])
    return places_of_boxes(network, sizes.links, box), box


def _texts(svg: str) -> list[str]:
    return re.findall(r"<text[^>]*>([^<]*)</text>", svg)


def test_the_picture_names_every_node_with_its_loss_and_says_where(reference: Network, tmp_path: Path) -> None:
    texts = _texts(_svg(reference, tmp_path, "speed_rpm=16000", "current_A=450"))
    assert {name.replace("_", " ") for name in reference.names} <= set(texts)
    assert "110 W" in texts and "1.75 kW" in texts, "a bearing and the teeth, as the file says"
    (title,) = [text for text in texts if text.startswith("reference-150kW:")]
    assert title.endswith("of loss at 16,000 rpm, 450 A rms and 5 l/min")
    assert {"100 W/K", "10 W/K", "1 W/K", "boundary", "magnet"} <= set(texts)


def test_half_of_the_scale_is_drawn_where_nothing_is_said(reference: Network) -> None:
    assert operating_point(reference, ()) == {"speed_rpm": 8000.0, "current_A": 225.0, "flow_lpm": 5.0}
    assert operating_point(reference, ["flow_lpm=2"])["flow_lpm"] == 2.0


def test_names_do_not_overlap(reference: Network) -> None:
    place, box = _placed(reference)
    gap, room = np.abs(place[:, None] - place[None]), (box[:, None] + box[None]) / 2
    inside = (room > gap).all(axis=2)
    assert not (inside & ~np.eye(len(box), dtype=np.bool_)).any()


@pytest.mark.parametrize("name", ["reference_motor", "hust_motor"])
def test_labels_are_whole_and_apart_in_a_browser(name: str, tmp_path: Path) -> None:
    network = read_motor((EXAMPLES / name / "motor.toml").read_bytes(), "motor.toml")
    _svg(network, tmp_path)
    assert label_faults(tmp_path / f"{network.name}.svg") == []


def test_the_side_and_the_outside_of_the_motor_are_where_one_expects_them(reference: Network) -> None:
    place, _ = _placed(reference)
    at = dict(zip(reference.names, place, strict=True))
    assert at["endwinding_a_inner"][0] < at["winding_a"][0] < at["winding_b"][0] < at["endwinding_b_inner"][0]
    assert at["jacket"][1] > at["teeth"][1] > at["magnet"][1]


def test_links_are_as_wide_as_they_conduct() -> None:
    widths = [network_plot._width(value, 100.0) for value in (100.0, 10.0, 1.0, 1e-6)]
    assert widths == sorted(widths, reverse=True) and widths[0] == network_plot.WIDE
    assert widths[0] - widths[1] == pytest.approx(network_plot.DECADE)
    assert widths[3] == network_plot.THIN


def test_a_small_network_says_its_conductances(tmp_path: Path) -> None:
    hust = read_motor((EXAMPLES / "hust_motor" / "motor.toml").read_bytes(), "motor.toml")
    assert {"72.7 W/K", "53.2 W/K", "1.71 W/K", "0.2 W/K"} <= set(_texts(_svg(hust, tmp_path)))


def test_several_hundred_nodes_are_dots_with_one_name_a_part(reference: Network, tmp_path: Path) -> None:
    cut = sliced(reference, ["yoke", "teeth", "winding_a", "winding_b", "rotor_core", "magnet"], 20, 0.13)
    texts = _texts(_svg(cut, tmp_path))
    assert {"teeth × 20", "winding a × 10", "housing", "coolant"} <= set(texts)
    assert "teeth 3" not in texts


def test_a_circuit_is_drawn_with_its_direction(reference: Network, tmp_path: Path) -> None:
    water = Fluid(Property((20.0,), (1050.0,)), Property((20.0,), (3500.0,)))
    wet = replace(
        reference,
        nodes=(*reference.nodes, Node("water", 100.0, "fluid")),
        circuits=(FluidCircuit("channel", "coolant", ("water", "jacket"), water),),
    )
    plain, drawn = _svg(reference, tmp_path), _svg(wet, tmp_path)
    assert "fluid flows" in _texts(drawn) and "fluid flows" not in _texts(plain)


def test_a_motor_at_rest_is_drawn_though_some_links_conduct_nothing(reference: Network, tmp_path: Path) -> None:
    assert "0.0 W" in _texts(_svg(reference, tmp_path, "speed_rpm=0", "current_A=0", "flow_lpm=0"))


def test_the_same_network_gives_the_same_bytes(reference: Network, tmp_path: Path) -> None:
    assert _svg(reference, tmp_path) == _svg(reference, tmp_path)
