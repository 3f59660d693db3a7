"""A motor file with other numbers: coefficients and capacities are replaced where they stand, all else stays as written."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterator

from ingest.toml_lines import lines
from replay.engine.motor_file import read_motor
from replay.errors import MotorFileError
from twin.features import terms
from twin.network import Network

_NUMBER = r"[+-]?[0-9][0-9_]*(?:\.[0-9_]+)?(?:[eE][+-]?[0-9]+)?"


def rewritten(data: bytes, name: str, network: Network, says: str) -> bytes:
    """The motor file `data` (`name` as in messages) with the coefficients and capacities of `network`, to 7 digits, and
    under its first line the comment `says`. Raises MotorFileError where a number cannot be replaced in its place.
    """
    text = data.decode("utf-8-sig").splitlines(keepends=True)
    places: defaultdict[tuple[int, str], list[float]] = defaultdict(list)
    where = lines("".join(text))
    for path, value in _numbers(network):
        if path not in where:
            raise MotorFileError(_refusal(name, path))
        places[where[path], str(path[-1])].append(value)
    for (line, key), values in places.items():
        text[line - 1] = _replaced(text[line - 1], key, values)
    text.insert(1, "".join(f"# {part}\n" for part in says.splitlines()))
    result = "".join(text).encode()
    found, wanted = _values(read_motor(result, name)), _values(network)
    wrong = [i for i, (a, b) in enumerate(zip(found, wanted, strict=True)) if abs(a - b) > 1e-6 * abs(b)]
    if wrong:
        raise MotorFileError(_refusal(name, [path for path, _ in _numbers(network)][wrong[0]]))
    return result


def _numbers(network: Network) -> Iterator[tuple[tuple[str | int, ...], float]]:
    """Each number's path in the file, in the order of the file's tables."""
    for i, node in enumerate(network.nodes):
        yield ("node", i, "capacity"), node.capacity
    places = [("link", i, link.terms) for i, link in enumerate(network.links)]
    places += [("source", i, source.terms) for i, source in enumerate(network.sources)]
    for table, i, group in places:
        for j, term in enumerate(group):
            yield (table, i, "terms", j, "coefficient"), term.coefficient


def _values(network: Network) -> list[float]:
    return [*(node.capacity for node in network.nodes), *(term.coefficient for term in terms(network))]


def _replaced(line: str, key: str, values: list[float]) -> str:
    left = iter(values)
    pattern = re.compile(rf"(\b{key}\s*=\s*){_NUMBER}")
    return pattern.sub(lambda m: f"{m[1]}{next(left):.7g}" if values else m[0], line, count=len(values))


def _refusal(name: str, path: tuple[str | int, ...]) -> str:
    table, index = path[0], path[1]
    return (
        f"{name}: [[{table}]] number {int(index) + 1}: its {path[-1]} cannot be replaced in its place: write {path[-1]} = "
        "and the number side by side on one line."
    )
