"""Networks and inputs that the tests of the twin share."""

from __future__ import annotations

import types
from collections.abc import Callable
from typing import Any, cast

import numpy as np
import pytest

from twin.motor.features import evaluate, monomials
from twin.motor.network import Boundary, Link, Network, Node, Source, TemperatureFactor, Term
from twin.run.simulate import Frame

MakeNetwork = Callable[..., Network]
MakeFrame = Callable[..., Frame]


def _network(seed: int, n: int = 8, linear: bool = False) -> Network:
    """A connected network of n nodes and two boundaries; `linear`: no factor but copper."""
    rng = np.random.default_rng(seed)
    names = [f"n{i}" for i in range(n)]

    def factor(chance: float) -> TemperatureFactor | None:
        if linear or rng.random() > chance:
            return None
        return TemperatureFactor(names[int(rng.integers(n))], float(rng.uniform(-0.002, 0.003)), 40.0)

    def conductance() -> tuple[Term, ...]:
        terms = [Term(float(rng.uniform(0.5, 30)), temperature=factor(0.3))]
        if rng.random() < 0.5:
            terms.append(Term(float(rng.uniform(0.5, 10)), {"speed": 0.8}, temperature=factor(0.2)))
        return tuple(terms)

    def loss() -> tuple[Term, ...]:
        copper = Term(float(rng.uniform(50, 300)), {"current": 2.0}, copper=True, temperature=factor(0.3))
        ac = Term(float(rng.uniform(20, 100)), {"current": 2.0, "speed": 2.0}, resistance=0 if linear else -1)
        iron = Term(float(rng.uniform(-20, 100)), {"speed": 1.5}, temperature=factor(0.3))
        return tuple(term for term in (copper, ac, iron) if rng.random() < 0.6) or (copper,)

    pairs = {(int(rng.integers(i)), i) for i in range(1, n)}
    pairs |= {tuple(sorted(map(int, rng.choice(n, 2, replace=False)))) for _ in range(n // 2)}  # type: ignore[misc]
    links = [Link(names[j], names[i], conductance()) for i, j in sorted(pairs)]
    links += [Link("coolant", names[0], conductance()), Link(names[-1], "ambient", conductance())]
    return Network(
        name="random",
        nodes=tuple(Node(name, float(rng.uniform(50, 3000)), "other") for name in names),
        boundaries=(Boundary("coolant"), Boundary("ambient")),
        links=tuple(links),
        sources=tuple(Source(name, loss()) for name in names if rng.random() < 0.6),
        scale={"speed": 1000.0, "current": 100.0},
    )


def _frame(network: Network, seed: int, steps: int = 40, step_s: float = 0.5) -> Frame:
    """Features that jump every few steps, boundaries that drift."""
    rng = np.random.default_rng(seed)
    u = {name: np.repeat(rng.random(steps // 4 + 1), 4)[:steps] for name in ("speed", "current")}
    around = 30 + np.cumsum(rng.normal(0, 0.2, (steps, len(network.boundaries))), axis=0)
    return Frame(step_s, evaluate(monomials(network), u, steps), around)


def _plain(source: str) -> Callable[..., None]:
    """A kernel's source as plain Python: the same text without its compiler."""
    stand_in = types.SimpleNamespace(njit=lambda *_, **__: lambda function: function)
    namespace: dict[str, Any] = {"numba": stand_in}
    text = source.replace("cache=CACHE", "cache=False").replace("import numba\n", "")
    exec(compile(text, "<kernel>", "exec"), namespace)  # noqa: S102
    return cast(Callable[..., None], namespace["run"])


@pytest.fixture(scope="session")
def make_network() -> MakeNetwork:
    return _network


@pytest.fixture(scope="session")
def make_frame() -> MakeFrame:
    return _frame


@pytest.fixture(scope="session")
def plain() -> Callable[[str], Callable[..., None]]:
    return _plain
