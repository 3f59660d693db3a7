from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import replace
from random import Random
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from made import can_bench
from made.places import EXAMPLES
from plant.forms import JACKETED
from plant.rules import fitted
from replay.engine.files.motor_file import read_motor
from replay.engine.files.motor_text import written
from replay.errors import MotorFileError
from twin.motor.network import (
    Boundary,
    Configuration,
    Fluid,
    FluidCircuit,
    Link,
    Map,
    Network,
    Node,
    Property,
    Shape,
    Source,
    TemperatureFactor,
    Term,
)

SHAPE = Shape((0.0, 0.25, 1.0), (0.1, -0.2, 0.05), (0.0, 0.1, 0.0))


def _same(found: Any, wanted: Any) -> bool:
    """Equal in all but numbers, and these to 6 digits; an exponent of 0 is no exponent."""
    if isinstance(wanted, float | int) and not isinstance(wanted, bool):
        return bool(found == pytest.approx(wanted, rel=1e-6, abs=1e-12))
    if isinstance(wanted, tuple):
        return len(found) == len(wanted) and all(map(_same, found, wanted))
    if isinstance(wanted, dict):
        found, wanted = ({k: v for k, v in d.items() if v != 0} for d in (found, wanted))
        return set(found) == set(wanted) and all(_same(found[k], wanted[k]) for k in wanted)
    if hasattr(wanted, "__dict__"):
        return type(found) is type(wanted) and _same(vars(found), vars(wanted))
    return bool(found == wanted)


# --- One change at a time --------------------------------------------------------------------------------------------


def _servo() -> Network:
    return read_motor(can_bench.MOTOR.encode(), "motor.toml")


def _written(network: Network, text: str = can_bench.MOTOR, says: str = "Found.") -> str:
    return written(text.encode(), "motor.toml", network, says).decode()


def _with_terms(network: Network, index: int, *terms: Term) -> Network:
    sources = list(network.sources)
    sources[index] = replace(sources[index], terms=terms)
    return replace(network, sources=tuple(sources))


def test_numbers_are_replaced_where_they_stand_and_comments_stay() -> None:
    motor = can_bench.MOTOR.replace("coefficient = 12.0}]", "coefficient = 12.0}]  # coefficient = 7 in an older file")
    network = read_motor(motor.replace("12.0", "13.5").replace("900.0", "1e3").encode(), "motor.toml")
    text = _written(network, motor, "Calibrated.\nBy a test.")
    assert "terms = [{coefficient = 13.5}]  # coefficient = 7 in an older file" in text
    assert "terms = [{coefficient = 1.0}, {coefficient = 2.0, speed = 0.8}]" in text
    assert text.splitlines()[1:3] == ["# Calibrated.", "# By a test."]
    assert read_motor(text.encode(), "motor.toml") == network


def test_a_quoted_key_and_other_spacing_are_found() -> None:
    motor = can_bench.MOTOR.replace(
        'name = "winding"\ncapacity = 900.0', '"name"="winding"\n\t"capacity"  =  9e2 # J/K'
    )
    text = _written(read_motor(motor.replace("9e2", "950.0").encode(), "motor.toml"), motor)
    assert '\t"capacity"  =  950 # J/K' in text


def test_the_comment_stands_above_all_where_the_file_names_no_schema() -> None:
    motor = can_bench.MOTOR.replace('schema = "whyhot.motor/1"\n', "")
    text = _written(read_motor(motor.replace("900.0", "901.0").encode(), "motor.toml"), motor)
    assert text == "# Found.\n" + motor.replace("900.0", "901")


def test_a_term_keeps_its_line_and_takes_exponent_factor_and_shape() -> None:
    network = _servo()
    factor = TemperatureFactor("yoke", -0.001, 40.0)
    term = replace(
        network.sources[1].terms[0], coefficient=70.0, exponents={"speed": 1.25}, temperature=factor, shape=SHAPE
    )
    text = _written(_with_terms(network, 1, term))
    (line,) = [line for line in text.splitlines() if "1.25" in line]
    assert line == (
        "terms = "
        '[{coefficient = 70, speed = 1.25, temperature = {node = "yoke", slope_per_K = -0.001, reference_degC = 40}, '
        "shape = {speed_rpm = [0, 1500, 6000], factor = [0.1, -0.2, 0.05], current_slope = [0, 0.1, 0]}}]"
    )


def test_an_added_term_joins_its_source_and_says_its_sd_only_where_the_default_is_another() -> None:
    network = _servo()
    terms = (*network.sources[2].terms, Term(96.0, {"speed": 2.0, "current": 2.0}, sd=0.5), Term(4.0, sd=0.3))
    text = _written(_with_terms(network, 2, *terms), says="Magnet loss.\nMore.")
    assert text.endswith(
        'node = "magnet"\nterms = [\n  {coefficient = 30.0, speed = 2.0},\n  # added: Magnet loss.\n'
        "  {coefficient = 96, speed = 2, current = 2},\n  {coefficient = 4, sd = 0.3},\n]\n"
    )


def test_added_tables_stand_behind_their_own_kind() -> None:
    network = _servo()
    added = replace(
        network,
        nodes=(*network.nodes, Node("shaft", 300.0, "rotor", 0.3, 150.0)),
        boundaries=(*network.boundaries, Boundary("ambient")),
        links=(*network.links, Link("shaft", "magnet", (Term(2.0),)), Link("shaft", "ambient", (Term(0.5, sd=1.0),))),
        sources=(*network.sources, Source("shaft", (Term(9.0, {"speed": 1.5}),))),
    )
    added = replace(added, sources=(*added.sources[:-1], Source("shaft", (Term(9.0, {"speed": 1.5}, sd=0.15),))))
    text = _written(added)
    kinds = re.findall(r"^\[+(\w+)\]+", text, re.MULTILINE)
    assert kinds == ["scale", *["node"] * 4, *["boundary"] * 2, *["link"] * 5, *["source"] * 4]
    assert text.count("# added: Found.") == 4
    assert (
        '\n# added: Found.\n[[node]]\nname = "shaft"\ncapacity = 300\nlimit_degC = 150\nsd = 0.3\n[[boundary]]' in text
    )


def test_a_copper_loss_in_an_iron_node_does_not_change_its_region() -> None:
    network = _servo()
    assert network.nodes[1].region == "iron"
    (iron,) = network.sources[1].terms
    text = _written(_with_terms(network, 1, iron, Term(5.0, {"current": 2.0}, sd=0.05, copper=True)))
    assert 'name = "yoke"\ncapacity = 3500.0\nregion = "iron"\n' in text
    assert read_motor(text.encode(), "motor.toml").nodes == network.nodes


def test_a_default_sd_that_follows_the_exponent_is_kept_when_the_exponent_changes() -> None:
    network = _servo()
    (dc,) = network.sources[0].terms
    text = _written(_with_terms(network, 0, replace(dc, exponents={"current": 1.9})))
    assert "{coefficient = 240.0, current = 1.9, copper = true, sd = 0.05}" in text


def test_a_network_that_the_file_says_already_changes_nothing() -> None:
    assert _written(_servo()) == can_bench.MOTOR
    barely = replace(_servo(), nodes=tuple(replace(n, capacity=n.capacity * (1 + 1e-9)) for n in _servo().nodes))
    assert _written(barely) == can_bench.MOTOR


def _without_a_source(network: Network) -> Network:
    return replace(network, sources=network.sources[1:])


def _with_a_link_in_front(network: Network) -> Network:
    return replace(network, links=(Link("winding", "coolant", (Term(1.0),)), *network.links))


def _without_an_exponent(network: Network) -> Network:
    return _with_terms(network, 1, replace(network.sources[1].terms[0], exponents={}))


def _with_another_scale(network: Network) -> Network:
    return replace(network, scale={**network.scale, "speed": 7000.0})


def _with_a_factor_of_nothing(network: Network) -> Network:
    return _with_terms(
        network, 1, replace(network.sources[1].terms[0], temperature=TemperatureFactor("shaft", 0.1, 20.0))
    )


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (
            _without_a_source,
            r"^motor\.toml: \[\[source\]\] 1 \(winding\) or one of its terms is not in its place in the new",
        ),
        (
            _with_a_link_in_front,
            r"^motor\.toml: \[\[link\]\] 1 \(winding-yoke\) or one of its terms is not in its place",
        ),
        (_without_an_exponent, r"^motor\.toml: the new version would not say source 2 terms 1 speed as it should be"),
        (_with_another_scale, r"^motor\.toml: the new version would not say scale speed as it should be"),
        (_with_a_factor_of_nothing, r'^motor\.toml:\d+: .*temperature: there is no node "shaft"'),
    ],
)
def test_what_a_version_cannot_say_is_refused_in_one_line(change: Any, says: str) -> None:
    with pytest.raises(MotorFileError, match=says) as refused:
        _written(change(_servo()))
    assert "\n" not in str(refused.value)


# --- Files as they are -----------------------------------------------------------------------------------------------

FILES = {path.parent.name: path.read_text(encoding="utf-8") for path in sorted(EXAMPLES.glob("*/motor.toml"))}


def _file(name: str) -> str:
    return fitted(JACKETED) if name == "plant" else FILES[name]


@pytest.mark.parametrize("name", [*FILES, "plant"])
def test_a_calibrated_and_extended_motor_reads_back_and_keeps_every_comment(name: str) -> None:
    text = _file(name)
    network = read_motor(text.encode(), name)
    for seed in range(3):
        changed = _changed(network, Random(seed))
        result = _written(changed, text)
        assert _same(read_motor(result.encode(), name), changed)
        assert _subsequence(re.findall("#.*", text), re.findall("#.*", result))


@pytest.mark.parametrize("name", [*FILES, "plant"])
def test_one_number_of_a_shipped_motor_is_one_line(name: str) -> None:
    text = _file(name)
    network = read_motor(text.encode(), name)
    last = network.sources[-1]
    terms = (*last.terms[:-1], replace(last.terms[-1], coefficient=last.terms[-1].coefficient * 1.01))
    result = _written(_with_terms(network, len(network.sources) - 1, *terms), text)
    assert sum(a != b for a, b in zip(text.splitlines(), _without("# Found.", result), strict=True)) == 1


def _without(line: str, text: str) -> list[str]:
    lines = text.splitlines()
    lines.remove(line)
    return lines


def _subsequence(part: list[str], whole: list[str]) -> bool:
    left: Iterator[str] = iter(whole)
    return all(any(one == other for other in left) for one in part)


# --- Random files, random changes ------------------------------------------------------------------------------------


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 1_000_000_000))
def test_any_change_of_any_file_reads_back_and_leaves_the_rest_as_written(seed: int) -> None:
    random = Random(seed)
    text = _Styled(random).file()
    network = read_motor(text.encode(), "motor.toml")
    assert _written(network, text) == text
    changed = _changed(network, random)
    result = _written(changed, text)
    assert _same(read_motor(result.encode(), "motor.toml"), changed)
    assert _subsequence(re.findall(r"# c\d+", text), re.findall(r"# c\d+", result))
    if "\r\n" in text:
        assert result.count("\n") == result.count("\r\n")
    assert result.startswith("\ufeff") == text.startswith("\ufeff")
    assert _written(changed, result) == result


def _changed(network: Network, random: Random) -> Network:
    """Some numbers changed, some factors and shapes given, some entries added."""
    names = [node.name for node in network.nodes]

    def some(chance: float = 0.3) -> bool:
        return random.random() < chance

    def moved(value: float) -> float:
        return value * random.uniform(0.5, 1.5)

    def shape(old: Shape | None) -> Shape:
        knots = tuple(i / 4 for i in range(random.randint(2, 5) if old is None else len(old.speed)))
        slope = random.random() * 0.1
        return Shape(
            knots, tuple(random.uniform(-0.4, 0.4) for _ in knots), tuple(slope * i for i in range(len(knots)))
        )

    def term(old: Term, in_link: bool) -> Term:
        new = replace(old, coefficient=moved(old.coefficient)) if some() else old
        if some():
            new = replace(
                new, exponents={f: moved(e) for f, e in new.exponents.items()} | {"speed": random.choice([0.8, 2.0])}
            )
        if some(0.15):
            factor = TemperatureFactor(random.choice(names), random.uniform(-1e-3, 1e-3), 20.0)
            new = replace(new, temperature=factor)
        if some(0.15) and not in_link and not isinstance(new.shape, Map):
            new = replace(new, shape=shape(new.shape))
        if some(0.15) and in_link:
            new = replace(new, law=random.choice(["radiation", "free_convection"]))
        if some(0.1):
            new = replace(new, sd=moved(new.sd))
        return new

    def terms(old: tuple[Term, ...], in_link: bool) -> tuple[Term, ...]:
        added = [Term(moved(5.0), random.choice([{}, {"speed": 1.25}])) for _ in range(random.randint(0, 2)) if some()]
        if some(0.1) and not in_link:
            added.append(Term(moved(9.0), {"current": 2.0}, random.choice([0.05, 0.1]), copper=True))
        return tuple(term(one, in_link) for one in (*old, *added))

    nodes = [replace(node, capacity=moved(node.capacity)) if some() else node for node in network.nodes]
    links = [replace(link, terms=terms(link.terms, in_link=True)) for link in network.links]
    sources = [replace(source, terms=terms(source.terms, in_link=False)) for source in network.sources]
    for i in range(random.randint(0, 2)):
        name = f"added_{i}"
        nodes.append(Node(name, moved(50.0), random.choice(["iron", "copper"]), 0.2, random.choice([None, 150.0])))
        links.append(Link(name, random.choice(names), (Term(moved(2.0)), Term(moved(3.0), {"speed": 0.5}))))
        if some():
            sources.append(Source(name, terms((Term(moved(3.0), {"current": 2.0}),), in_link=False)))
    found = replace(network, nodes=tuple(nodes), links=tuple(links), sources=tuple(sources))
    return _cooled(found, random) if "flow" in network.scale and some() and not network.circuits else found


def _cooled(network: Network, random: Random) -> Network:
    """With a circuit, and the same motor dry."""
    table = Property((20.0, 90.0), (3300.0 * random.uniform(0.9, 1.1), 3600.0))
    through = network.nodes[-1].name
    fluid = Fluid(Property((20.0,), (1050.0,)), table)
    still = Link(through, network.boundaries[0].name, (Term(0.7, law="radiation"), Term(random.uniform(1.0, 2.0))))
    return replace(
        network,
        circuits=(FluidCircuit("jacket", network.boundaries[0].name, (through,), fluid),),
        configurations=(Configuration("dry", (), (still,), (Source(through, (Term(random.uniform(5, 9)),)),)),),
    )


class _Styled:
    """A motor file of a random network, written in one of the many ways that TOML allows."""

    def __init__(self, random: Random) -> None:
        self._random = random
        self._count = 0

    def file(self) -> str:
        data = self._data()
        heads = list(data)
        self._random.shuffle(heads)
        inline = [kind for kind in heads if self._some(0.2)]
        lines = [f"{self._key(kind)} = {self._array(data[kind])}{self._comment()}" for kind in inline]
        lines.insert(0, 'name = "m"' + self._comment())
        if self._some(0.7):
            lines.insert(self._random.randint(0, 1), 'schema = "whyhot.motor/1"' + self._comment())
        blocks = [["[scale]", "speed_rpm = 8_000.0", "current_A = 3e2 " + self._comment(), "flow_lpm = 10"]]
        queues = {kind: list(data[kind]) for kind in heads if kind not in inline}
        mixed = [kind for kind, queue in queues.items() for _ in queue]
        if self._some(0.3):
            self._random.shuffle(mixed)  # kinds need not stand together
        blocks += [self._block(kind, queues[kind].pop(0)) for kind in mixed]
        lines += [line for block in blocks for line in ([self._comment().strip()] if self._some(0.3) else []) + block]
        text = "\n".join(lines) + "\n" * self._random.randint(0, 2)
        mark = "\ufeff" if self._some(0.1) else ""
        return mark + (text.replace("\n", "\r\n") if self._some(0.2) else text)

    def _some(self, chance: float = 0.5) -> bool:
        return self._random.random() < chance

    def _comment(self) -> str:
        if self._some(0.6):
            return ""
        self._count += 1
        return f"  # c{self._count} {self._random.choice(['', '], } = 1', '[[node]]', 'coefficient = 7,', chr(34)])}"

    def _data(self) -> dict[str, list[dict[str, Any]]]:
        names = [f"n{i}" for i in range(self._random.randint(1, 4))]
        ends = [*zip(names, [*names[1:], "coolant"], strict=True)]
        nodes = [
            {"name": n, "capacity": self._number(100)} | ({"region": "iron"} if self._some() else {}) for n in names
        ]
        return {
            "node": nodes,
            "boundary": [{"name": "coolant"}],
            "link": [{"between": [a, b], "terms": self._terms(names, in_link=True)} for a, b in ends],
            "source": [{"node": n, "terms": self._terms(names, in_link=False)} for n in names if self._some(0.6)],
        }

    def _number(self, about: float) -> float:
        return float(f"{about * self._random.uniform(0.5, 1.5):.{self._random.randint(2, 9)}g}")

    def _terms(self, names: list[str], in_link: bool) -> list[dict[str, Any]]:
        return [self._term(names, in_link) for _ in range(self._random.randint(1, 3))]

    def _term(self, names: list[str], in_link: bool) -> dict[str, Any]:
        term: dict[str, Any] = {"coefficient": self._number(5)}
        features = self._random.sample(
            ["speed", "flow", "current", "hours_above_162.5degC"], self._random.randint(0, 2)
        )
        term |= {feature: self._random.choice([0, 1, 2, 0.8]) for feature in features}
        if not in_link and self._some(0.3):
            term |= self._random.choice([{"copper": True}, {"copper": False}, {"resistance": -1}])
        if self._some(0.3):
            factor = {"node": self._random.choice(names), "slope_per_K": 0.001, "reference_degC": 20}
            term["temperature"] = factor
        if not in_link and self._some(0.3):
            slope = {"current_slope": [0.1, 0, 0]} if self._some() else {}
            term["shape"] = {"speed_rpm": [0, 2000, 8000], "factor": [0, self._number(0.1), 0]} | slope
        return term | ({"sd": 0.25} if self._some(0.2) else {})

    def _key(self, key: str) -> str:
        return json.dumps(key) if "." in key or self._some(0.1) else key

    def _pairs(self, table: dict[str, Any]) -> list[tuple[str, Any]]:
        pairs = list(table.items())
        self._random.shuffle(pairs)
        return pairs

    def _block(self, kind: str, entry: dict[str, Any]) -> list[str]:
        headed = "terms" in entry and self._some(0.3)
        lines = [f"[[{kind}]]"]
        for key, value in self._pairs({k: v for k, v in entry.items() if k != "terms" or not headed}):
            lines.append(f"{self._key(key)} = {self._value(value)}{self._comment()}")
        for term in entry["terms"] if headed else []:
            below = [key for key in ("temperature", "shape") if key in term and self._some(0.3)]
            lines.append(f"  [[{kind}.terms]]{self._comment()}")
            lines += [f"  {line}" for line in self._lines({k: v for k, v in term.items() if k not in below})]
            for key in below:
                lines += [f"  [{kind}.terms.{key}]", *self._lines(term[key])]
        return lines

    def _lines(self, table: dict[str, Any]) -> list[str]:
        """A table's pairs, tables within in braces or as dotted keys."""
        lines = []
        for key, value in self._pairs(table):
            if isinstance(value, dict) and self._some(0.3):
                lines += [f"{key} . {k} = {self._value(v)}{self._comment()}" for k, v in self._pairs(value)]
            else:
                lines.append(f"{self._key(key)} = {self._value(value)}{self._comment()}")
        return lines

    def _value(self, value: Any) -> str:
        if isinstance(value, dict):
            return self._braces(value)
        if isinstance(value, list):
            return self._array(value)
        return json.dumps(value)

    def _braces(self, table: dict[str, Any]) -> str:
        parts = []
        for key, value in self._pairs(table):
            if isinstance(value, dict) and self._some(0.2):
                parts += [f"{key}.{k} = {self._value(v)}" for k, v in self._pairs(value)]
            else:
                parts.append(f"{self._key(key)}{self._random.choice([' = ', '=', '  = '])}{self._value(value)}")
        blank = " " * self._some(0.2)
        return "{" + blank + self._random.choice([", ", ","]).join(parts) + blank + "}"

    def _array(self, values: list[Any]) -> str:
        written = [self._value(value) for value in values]
        comma = "," * (self._some() and bool(values))
        if self._some():
            return "[" + self._random.choice([", ", " , "]).join(written) + comma + "]"
        indent = " " * self._random.randint(0, 4)
        lines = [
            f"{indent}{one}{',' if i < len(written) - 1 else comma}{self._comment()}" for i, one in enumerate(written)
        ]
        return "\n".join([f"[{self._comment()}", *lines, f"{indent}]"])
