from __future__ import annotations

import platform
import re
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.integrator import frame, initial_of, motor, s2
from made.laws import law_frame, with_laws
from replay.engine.results.kernel_cache import load
from twin.arithmetic.interleaving import at_a_border
from twin.arithmetic.vectors import LANES
from twin.compiled.codegen_lanes import generate_side_by_side
from twin.compiled.integrators import BDF2, DEFAULT
from twin.compiled.kernel import Compiled, Run, compile_indexed, compile_network, load_in_memory
from twin.compiled.structure import structure
from twin.errors import DivergedError, FrameError
from twin.motor.network import Network
from twin.run import side_by_side
from twin.run.side_by_side import ENOUGH, simulate_all
from twin.run.simulate import Frame, simulate

Floats = NDArray[np.float64]
Load = Callable[[str], Callable[..., None]]
Make = Callable[..., Network]


def _sessions(network: Network, lengths: list[int], step_s: float = 0.5) -> tuple[list[Frame], list[Floats]]:
    frames = [law_frame(network, seed, steps, step_s) for seed, steps in enumerate(lengths)]
    return frames, [np.linspace(20.0 + seed, 80.0, len(network.nodes)) for seed in range(len(lengths))]


@pytest.fixture(scope="module")
def bent(make_network: Make, plain: Load) -> Compiled:
    """A network with every law."""
    return compile_network(with_laws(make_network(2, n=4), 2), load=plain)


@pytest.mark.parametrize("lengths", [[8, 31, 30, 1, 12, 12, 29, 31, 3], [9, 0, 8, 7], [40] * LANES])
def test_sessions_side_by_side_have_the_bits_that_they_have_alone(
    lengths: list[int], bent: Compiled, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(side_by_side, "CHUNK", 2 * LANES)
    frames, starts = _sessions(bent.network, lengths)
    for found, own, start in zip(simulate_all(bent, frames, starts), frames, starts, strict=True):
        np.testing.assert_array_equal(found, simulate(bent, own, start))


def test_sessions_of_another_step_go_on_their_own(bent: Compiled) -> None:
    frames, starts = _sessions(bent.network, [5] * (ENOUGH + 1))
    frames[2] = replace(frames[2], step_s=0.25)
    for found, own, start in zip(simulate_all(bent, frames, starts), frames, starts, strict=True):
        np.testing.assert_array_equal(found, simulate(bent, own, start))


def test_the_index_program_gives_the_same_bits_in_every_lane(make_network: Make, plain: Load) -> None:
    compiled = compile_indexed(with_laws(make_network(3, n=4), 3), load=plain)
    frames, starts = _sessions(compiled.network, [7, 9, 9, 2, 9, 9, 9, 8, 9])
    for found, own, start in zip(simulate_all(compiled, frames, starts), frames, starts, strict=True):
        np.testing.assert_array_equal(found, simulate(compiled, own, start))


@pytest.mark.parametrize("make", [compile_indexed, compile_network])
def test_compiled_lanes_of_every_law_give_the_bits_of_plain_numbers(
    make: Callable[..., Compiled], make_network: Make, plain: Load
) -> None:
    network = with_laws(make_network(5, n=4), 5)
    frames, starts = _sessions(network, [6] * ENOUGH)
    frames[0].features.setflags(write=False)
    frames[1] = replace(frames[1], boundaries=np.asfortranarray(frames[1].boundaries))
    compiled, alone = (make(network, load=how) for how in (load, plain))
    np.testing.assert_array_equal(simulate(compiled, frames[0], starts[0]), simulate(alone, frames[0], starts[0]))
    for found, own, start in zip(simulate_all(compiled, frames, starts), frames, starts, strict=True):
        np.testing.assert_array_equal(found, simulate(alone, own, start))


def test_a_method_that_looks_back_runs_one_session_after_the_other(make_network: Make, plain: Load) -> None:
    compiled = compile_network(make_network(1, n=3), BDF2, plain)
    assert compiled.together is None
    frames, starts = _sessions(compiled.network, [6] * ENOUGH)
    found = simulate_all(compiled, frames, starts)
    np.testing.assert_array_equal(found[2], simulate(compiled, frames[2], starts[2]))


def test_a_number_that_is_not_finite_is_found_in_any_session(bent: Compiled) -> None:
    frames, starts = _sessions(bent.network, [13] * (LANES - 1))
    for s, name, place in ((0, "features", (12, 0)), (3, "boundaries", (4, 1)), (LANES - 2, "features", (0, 2))):
        for wrong in (np.nan, -np.inf):
            array = getattr(frames[s], name).copy()
            array[place] = wrong
            given = [*frames[:s], replace(frames[s], **{name: array}), *frames[s + 1 :]]
            with pytest.raises(FrameError, match=rf"{name} are not finite first at \({place[0]}, {place[1]}\)"):
                simulate_all(bent, given, starts)


def test_what_memory_held_before_is_not_taken_for_a_run_where_an_input_is_refused(
    bent: Compiled, monkeypatch: pytest.MonkeyPatch
) -> None:
    def dirty(shapes: Sequence[tuple[int, ...]]) -> list[Floats]:
        found = at_a_border(shapes)
        for array in found:
            array[...] = np.nan
        return found

    monkeypatch.setattr(side_by_side, "at_a_border", dirty)
    frames, starts = _sessions(bent.network, [13] * (LANES - 1))
    features = frames[3].features.copy()
    features[12, 0] = np.nan
    with pytest.raises(FrameError, match="features are not finite first at"):
        simulate_all(bent, [*frames[:3], replace(frames[3], features=features), *frames[4:]], starts)


def test_a_session_that_does_not_fit_or_runs_away_is_refused_as_it_is_alone(bent: Compiled) -> None:
    frames, starts = _sessions(bent.network, [5] * LANES)
    bad = [*starts[:-1], starts[-1][:-1]]
    with pytest.raises(FrameError, match="initial of shape"):
        simulate_all(bent, frames, bad)
    starts[4] = starts[4] + 1e308
    with pytest.raises(DivergedError, match="leaves the finite numbers"), np.errstate(all="ignore"):
        simulate_all(bent, frames, starts)


def test_compiled_lanes_are_vector_instructions_and_give_the_bits_of_plain_numbers(plain: Load) -> None:
    """Were the loop over the lanes no longer made into vectors, nothing else would tell."""
    network = motor("reference_motor")
    source = generate_side_by_side(structure(network), DEFAULT)
    lanes = load_in_memory(source)
    (signature,) = lanes.signatures  # type: ignore[attr-defined]
    made = re.findall(r"= fmul (?:<(\d+) x )?double", lanes.inspect_llvm(signature))  # type: ignore[attr-defined]
    assert sum(width == str(LANES) for width in made) > 0.9 * source.split("for k in")[1].count(" * ")
    if platform.machine() == "x86_64":  # what is kept on the stack does not lie across lines of the cache
        assert re.search(r"andq\s+\$-64, %rsp", lanes.inspect_asm(signature))  # type: ignore[attr-defined]

    def together() -> Run:
        return lambda p, phi, boundaries, step_s, out: lanes(
            phi, boundaries, step_s, p.coefficients, p.capacities, p.copper, p.factors, out
        )

    alone = compile_network(network, load=plain)
    frames = [frame(network, s2(), 2.0)] * ENOUGH
    frames = [Frame(0.5, share * own.features[:40], own.boundaries[:40]) for share, own in enumerate(frames, 1)]
    starts = [initial_of(network) + seed for seed in range(ENOUGH)]
    found = simulate_all(replace(alone, together=together), frames, starts)
    for own, inputs, start in zip(found, frames, starts, strict=True):
        np.testing.assert_array_equal(own, simulate(alone, inputs, start))
