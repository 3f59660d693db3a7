from __future__ import annotations

import json
import re
from importlib.resources import files
from pathlib import Path
from typing import Any

import pytest

from ingest.bench.bench_file import read_bench
from ingest.bench.resolving import check_nodes
from made.places import EXAMPLES, ROOT
from replay.engine.files import motor_file
from replay.engine.files.motor_file import read_motor
from replay.errors import MotorFileError
from twin.motor.features import QUANTITY, monomials, quantity
from twin.motor.heat_laws import NAMED
from twin.motor.network import Copper, Network, Shape, TemperatureFactor

SCHEMA: dict[str, Any] = json.loads((files("replay") / "schema" / "motor.schema.json").read_text(encoding="utf-8"))

MOTOR = """\
schema = "whyhot.motor/1"
name = "two-lumps"
[scale]
speed_rpm = 1000.0
current_A = 100.0
[[node]]
name = "winding_a"
capacity = 100.0
limit_degC = 180.0
[[node]]
name = "magnet"
capacity = 50
[[boundary]]
name = "coolant"
[[link]]
between = ["winding_a", "coolant"]
terms = [{coefficient = 4.0}, {coefficient = 8.0, speed = 0.8, sd = 0.2}]
[[link]]
between = ["magnet", "winding_a"]
terms = [{coefficient = 1.0, temperature = {node = "magnet", slope_per_K = 0.01, reference_degC = 20}}]
[[source]]
node = "winding_a"
terms = [
  {coefficient = 90.0, current = 2, copper = true},
  {coefficient = 9.0, current = 2, speed = 2, resistance = -1},
]
[[source]]
node = "magnet"
terms = [{coefficient = -3.0, speed = 2}]
"""


def _read(text: str = MOTOR) -> Network:
    return read_motor(text.encode(), "motor.toml")


def test_a_motor_file_becomes_a_network_with_every_default_filled_in() -> None:
    network = _read()
    winding, magnet = network.nodes
    assert (network.name, network.copper) == ("two-lumps", Copper(0.00393, 20.0))
    assert network.scale == {"speed": 1000.0, "current": 100.0}
    assert (winding.capacity, winding.region, winding.sd, winding.limit_degC) == (100.0, "copper", 0.15, 180.0)
    assert (magnet.region, magnet.limit_degC) == ("magnet", None)
    assert [term.sd for link in network.links for term in link.terms] == [0.4, 0.2, 0.4]
    assert [term.sd for source in network.sources for term in source.terms] == [0.05, 0.15, 0.5]
    assert network.links[1].terms[0].temperature == TemperatureFactor("magnet", 0.01, 20.0)
    dc, ac = network.sources[0].terms
    assert (dc.copper, dc.resistance, dc.exponents) == (True, 0, {"current": 2.0})
    assert (ac.copper, ac.resistance, ac.exponents) == (False, -1, {"current": 2.0, "speed": 2.0})


def test_the_knots_of_a_shape_are_in_rpm_and_its_current_slope_may_be_left_out() -> None:
    shape = "shape = {speed_rpm = [0, 250, 1000], factor = [0.1, 0, -0.2]}"
    (term,) = _read(MOTOR.replace("coefficient = -3.0", f"coefficient = -3.0, {shape}")).sources[1].terms
    assert term.shape == Shape((0.0, 0.25, 1.0), (0.1, 0.0, -0.2), (0.0, 0.0, 0.0))
    sloped = shape.replace("}", ", current_slope = [0, 0, 0.5]}")
    (term,) = _read(MOTOR.replace("coefficient = -3.0", f"coefficient = -3.0, {sloped}")).sources[1].terms
    assert term.shape == Shape((0.0, 0.25, 1.0), (0.1, 0.0, -0.2), (0.0, 0.0, 0.5))


def test_a_shape_without_a_scale_of_speed_is_refused() -> None:
    plain = MOTOR.replace(", speed = 2", "").replace(", speed = 0.8", "").replace("speed_rpm = 1000.0\n", "")
    shaped = plain.replace(
        "{coefficient = -3.0}", "{coefficient = 3.0, shape = {speed_rpm = [0, 9], factor = [0, 0.1]}}"
    )
    _read(plain)
    with pytest.raises(MotorFileError, match=r"terms 1, shape: a shape needs what 1 means for speed: say speed_rpm in"):
        _read(shaped)


@pytest.mark.parametrize(
    ("name", "region"),
    [
        ("endwinding_b_outer", "copper"),
        ("terminal_rack", "copper"),
        ("stator_yoke", "iron"),
        ("teeth", "iron"),
        ("rotor_surface", "rotor"),
        ("shaft", "rotor"),
        ("end_plate_a", "rotor"),
        ("bearing_a", "bearing"),
        ("housing", "housing"),
        ("air_a", "fluid"),
        ("lump", "other"),
    ],
)
def test_a_region_left_out_follows_from_the_name(name: str, region: str) -> None:
    network = _read(MOTOR.replace("magnet", name))
    assert network.nodes[1].region == region


def test_a_copper_loss_makes_the_region_copper() -> None:
    assert _read(MOTOR.replace("winding_a", "lump")).nodes[0].region == "copper"


REFUSED = {
    "no toml": ('name = "two-lumps"', "name = two", r"^motor\.toml:2: is not TOML"),
    "unknown key": ("capacity = 50", "capcity = 50",
        r'^motor\.toml:12: \[\[node\]\] 2.*unknown key "capcity".*capacity'),
    "no capacity": ("capacity = 50\n", "", r"^motor\.toml:10: \[\[node\]\] 2 \(name \"magnet\"\): capacity is missing"),
    "negative capacity": ("capacity = 50", "capacity = -50", r"^motor\.toml:12: .*capacity must be a number above 0"),
    "region": ("capacity = 50", 'capacity = 50\nregion = "magnets"',
        r'^motor\.toml:13: .*region "magnets" is none of.*magnet'),
    "unknown node": (
        '"magnet", "winding_a"]',
        '"magnet", "windng_a"]',
        r'^motor\.toml:18: \[\[link\]\] 2 .*there is no node or boundary "windng_a": did you mean "winding_a"\?$',
    ),
    "no such node": ('node = "magnet"\nterms', 'node = "d"\nterms',
        r'there is no node "d": known are winding_a, magnet\.$'),
    "source of nothing": ('node = "magnet"\nterms', 'node = "magnets"\nterms', r'^motor\.toml:27: .*no node "magnets"'),
    "three ends": ('["magnet", "winding_a"]', '["magnet", "winding_a", "coolant"]',
        r"^motor\.toml:19: .*between has 3 names"),
    "unknown feature": ("speed = 0.8", "sped = 0.8", r'^motor\.toml:17: .*terms 2: unknown key "sped"\..*speed'),
    "no scale": ("speed_rpm = 1000.0\n", "", r'^motor\.toml:14: .*feature "speed" has no scale: say in \[scale\]'),
    "bad scale": ("speed_rpm", "speed_Hz", r'^motor\.toml:4: \[scale\]: unknown key "speed_Hz"'),
    "negative conductance": ("coefficient = 4.0", "coefficient = -4.0",
        r"^motor\.toml:15: .*term 1: coefficient -4 is negative"),
    "negative exponent": ("speed = 0.8", "speed = -0.8", r"exponent -0\.8: at 0 it would be infinite"),
    "resistance": ("resistance = -1", "resistance = 1", r"^motor\.toml:25: .*resistance must be -1"),
    "name": ('"two-lumps"', '"two lumps"', r"^motor\.toml:2: name must be a name of letters"),
    "node name": ('name = "coolant"', 'name = "Coolant"', r'^motor\.toml:13: .*a name begins with a-z'),
    "schema": ("whyhot.motor/1", "whyhot.motor/2", r'^motor\.toml:1: schema "whyhot\.motor/2" is newer'),
    "shape without speed": (
        "{coefficient = -3.0, speed = 2}",
        "{coefficient = -3.0, shape = {factor = [0, 0.1]}}",
        r"^motor\.toml:29: .*terms 1, shape: speed_rpm is missing: it must be a list of numbers",
    ),
    "shape of one number": (
        "{coefficient = -3.0, speed = 2}",
        "{coefficient = -3.0, shape = {speed_rpm = 0, factor = [0, 0.1]}}",
        r"^motor\.toml:29: .*speed_rpm must be a list of numbers, such as \[0, 4000, 16000\], found the number 0\.$",
    ),
    "shape with another key": (
        "{coefficient = -3.0, speed = 2}",
        "{coefficient = -3.0, shape = {speed_rpm = [0, 9], factor = [0, 0.1], slope = [0, 0]}}",
        r'^motor\.toml:29: .*unknown key "slope"',
    ),
    "shape of a cooling loss": (
        "{coefficient = -3.0, speed = 2}",
        "{coefficient = 3.0, shape = {speed_rpm = [0, 500], factor = [0, 0.2], current_slope = [0, -0.9]}}",
        (r"^motor\.toml:27: .*term 1: shape makes the loss -0\.15 times itself "
        r"at 500 rpm and a current of 1\.5: keep it above 0\.$"),
    ),
    "map in a file": ("coefficient = -3.0", 'coefficient = 1.0, map = "losses.csv"',
        r'^motor\.toml:29: .*map "losses\.csv" stands in a file'),
    "law": ("speed = 0.8", 'law = "radation"',
        r'^motor\.toml:17: .*law "radation" is none of radiation, free_convection\. Nearest: radiation'),
    "law of a loss": ("coefficient = -3.0", 'coefficient = 3.0, law = "radiation"',
        r'^motor\.toml:27: .*law "radiation" belongs to cond'),
    "no nodes": (MOTOR, 'name = "none"', r"there is no \[\[node\]\]: a motor needs at least one"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_a_motor_file_is_refused_by_line_and_entry(case: str) -> None:
    old, new, says = REFUSED[case]
    assert old in MOTOR
    with pytest.raises(MotorFileError, match=says) as caught:
        _read(MOTOR.replace(old, new, 1))
    assert "\n" not in str(caught.value)


def test_a_node_that_no_link_reaches_is_named_at_its_line() -> None:
    alone = MOTOR.replace("[[boundary]]", '[[node]]\nname = "shaft"\ncapacity = 9\n[[boundary]]')
    with pytest.raises(
        MotorFileError,
        match=r'^motor\.toml:13: \[\[node\]\] 3 \(name "shaft"\): no path of links or circuits leads to a b',
    ):
        _read(alone)


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*/motor.toml")), ids=lambda path: path.parent.name)
def test_every_shipped_motor_is_read(path: Path) -> None:
    assert read_motor(path.read_bytes(), path.name).nodes


def test_the_schema_allows_the_keys_that_the_reader_allows() -> None:
    parts = {"root": SCHEMA, "scale": SCHEMA["properties"]["scale"], "copper": SCHEMA["properties"]["copper"]}
    parts |= {name: SCHEMA["$defs"][name] for name in motor_file.KEYS if name in SCHEMA["$defs"]}
    keys = motor_file.KEYS | {"scale": tuple(motor_file.SCALES), "term": (*motor_file.KEYS["term"], *QUANTITY)}
    assert {name: set(part["properties"]) for name, part in parts.items()} == {n: set(k) for n, k in keys.items()}
    assert all(part["additionalProperties"] is False for part in parts.values())


def test_the_schema_and_the_page_say_every_law_of_a_link() -> None:
    assert SCHEMA["$defs"]["term"]["properties"]["law"]["enum"] == list(NAMED)
    page = (ROOT / "docs" / "motor_file.md").read_text(encoding="utf-8")
    rows = page.split("### Laws of a link")[1].split("###")[0]
    assert re.findall(r"^\| `(\w+)` \|", rows, re.MULTILINE) == ["law", *NAMED]


def test_the_schema_knows_regions_defaults_and_names_as_the_reader_does() -> None:
    node, copper = SCHEMA["$defs"]["node"]["properties"], SCHEMA["properties"]["copper"]["properties"]
    assert tuple(node["region"]["enum"]) == motor_file.REGIONS
    assert node["sd"]["default"] == motor_file.CAPACITY_SD
    assert (copper["alpha_per_K"]["default"], copper["reference_degC"]["default"]) == (0.00393, 20.0)
    assert SCHEMA["properties"]["schema"]["const"] == motor_file.SCHEMA
    for feature in ("flow_jacket", "hours_above_180degC"):
        assert any(re.search(pattern, feature) for pattern in SCHEMA["$defs"]["term"]["patternProperties"])


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*/motor.toml")), ids=lambda path: path.parent.name)
def test_the_bench_beside_a_shipped_motor_names_its_nodes_and_gives_its_inputs(path: Path) -> None:
    network, bench = (
        read_motor(path.read_bytes(), path.name),
        read_bench((path.parent / "bench.toml").read_bytes(), "bench.toml"),
    )
    check_nodes(bench, [node.name for node in network.nodes], [boundary.name for boundary in network.boundaries])
    placed = {channel.node for channel in bench.channels}
    assert {boundary.name for boundary in network.boundaries} <= placed
    needed = {quantity(feature) for monomial in monomials(network) for feature in monomial.features}
    assert needed <= {channel.quantity for channel in bench.channels}
