"""A motor with fewer nodes: recorded sessions say which mergers lead, kept ones which of them are made, and how many
nodes are enough."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ingest.facts.events import SessionRecorded
from ingest.facts.facts import Facts
from ingest.facts.store import Store
from replay.engine.files.network_text import network_text
from replay.engine.results.kernel_cache import load, load_kernel
from replay.errors import ReplayDataError
from replay.studies.sessions.recorded import test_of
from twin.compiled.kernel import Compiled, compile_indexed
from twin.fitting.model import Test
from twin.motor.configured import configured, restored
from twin.motor.merging import merged_configurations
from twin.motor.network import Network
from twin.run.reduction import Error, FullRun, Reduced, reductions, smallest
from twin.run.side_by_side import simulate_all

LEAST = 2  # the curve goes on below what was asked for, as far as measured nodes stay apart
ENOUGH_K = 0.5  # mean error on kept sessions that is left where the number of nodes is chosen
WIDTH = 118  # characters of a comment


@dataclass(frozen=True)
class Reduction:
    """The motor file with as many nodes as were asked for or are enough. `chosen` is one of `curve`, which runs from
    the full network down; `interest`: node whose errors count -> why."""

    text: bytes
    chosen: Reduced
    curve: tuple[Reduced, ...]
    interest: Mapping[str, str]


def reduce_motor(
    store: Store,
    facts: Facts,
    network: Network,
    to: int | None,
    on: Sequence[SessionRecorded],
    hold_out: Sequence[SessionRecorded],
    tell: Callable[[str], None] = lambda _: None,
) -> Reduction:
    """Merge `network` down to `to` nodes; None: to the fewest whose mean error on `hold_out` is at most `ENOUGH_K`.
    The truth is its own run on the recorded inputs; errors count at measured nodes and at the hottest winding and
    magnet.

    Raises ReplayDataError where a session lacks what the motor needs, none is given, one is on both sides, `to` is no
    number of nodes below those that the motor has, or it is left out and no session is kept or no smaller network is
    good enough on those.
    """
    _check(network, to, on, hold_out)
    motor, network = network, configured(network, None)
    tests = {session.session: test_of(store, facts, session, network, (), "testing") for session in (*on, *hold_out)}
    full = load_kernel(network)
    trained = _courses(full, [tests[session.session] for session in on])
    kept = _courses(full, [tests[session.session] for session in hold_out])
    channels = [channel for test in tests.values() for channel in test.channels]
    measured = {node: "measured" for channel in channels for node in channel.sensor.weights}
    hottest = _hottest(network, trained)
    interest = {node: ", ".join(w for w in (measured.get(node), hottest.get(node)) if w) for node in measured | hottest}
    below = max(LEAST, len(measured))
    least = below if to is None else min(to, below)
    curve = reductions(network, trained, kept, list(interest), list(measured), least, _prepare, tell)
    chosen = _chosen(network, curve, to)
    rigs = merged_configurations(motor, chosen.groups)
    name = f"{network.name}_{len(chosen.groups)}_nodes"
    smaller = restored(replace(motor, configurations=rigs), replace(chosen.network, name=name))
    lost = [one.name for one in motor.configurations if one.name not in {rig.name for rig in rigs}]
    return Reduction(network_text(smaller, _says(network, chosen, on, hold_out, lost)), chosen, curve, interest)


def _chosen(network: Network, curve: Sequence[Reduced], to: int | None) -> Reduced:
    if to is None:
        enough = smallest(curve, ENOUGH_K)
        if enough is None:
            raise ReplayDataError(
                f"no smaller network than {network.name} itself stays within {ENOUGH_K:g} K on average on the kept "
                "sessions: say with --to how many nodes it shall have."
            )
        return enough
    chosen = next((level for level in curve if len(level.groups) == to), None)
    if chosen is None:
        sizes = ", ".join(str(len(level.groups)) for level in curve)
        raise ReplayDataError(f"--to {to}: {network.name} was merged to {sizes} nodes on the way: give one of these.")
    return chosen


def _check(
    network: Network, to: int | None, on: Sequence[SessionRecorded], hold_out: Sequence[SessionRecorded]
) -> None:
    if not on:
        raise ReplayDataError("no session to merge by: name some with --on. `whyhot sessions` lists them.")
    if to is None and not hold_out:
        raise ReplayDataError(
            "how many nodes are enough is chosen by the error on kept sessions: "
            "name some with --hold-out, or a number with --to."
        )
    if to is not None and not 1 <= to < len(network.nodes):
        raise ReplayDataError(
            f"--to {to}: {network.name} has {len(network.nodes)} nodes: give a number from 1 to "
            f"{len(network.nodes) - 1}."
        )
    kept = {session.session for session in hold_out}
    if both := [session.name for session in on if session.session in kept]:
        raise ReplayDataError(f"session {both[0]} is both in --on and in --hold-out: take it out of one.")


def _courses(full: Compiled, tests: Sequence[Test]) -> list[FullRun]:
    runs = simulate_all(full, [test.frame for test in tests], [test.initial for test in tests])
    return [FullRun(test.frame, run) for test, run in zip(tests, runs, strict=True)]


def _prepare(network: Network) -> Compiled:
    """By the index program: nothing is compiled for the many networks on the way."""
    return compile_indexed(network, load=load)


def _hottest(network: Network, courses: Sequence[FullRun]) -> dict[str, str]:
    """The hottest node of copper and of magnets over the runs."""
    peak = np.max([course.temperatures.max(axis=0) for course in courses], axis=0)
    found = {}
    for region, says in (("copper", "hottest winding"), ("magnet", "hottest magnet")):
        mine = [i for i, node in enumerate(network.nodes) if node.region == region]
        if mine:
            found[network.nodes[max(mine, key=lambda i: float(peak[i]))].name] = says
    return found


def _says(
    network: Network,
    chosen: Reduced,
    on: Sequence[SessionRecorded],
    hold_out: Sequence[SessionRecorded],
    lost: Sequence[str],
) -> str:
    """What the new file says above: where it comes from, how good it is, what follows what, and which configurations
    it lost."""
    learnt, kept = (", ".join(session.name for session in some) for some in (on, hold_out))
    sizes = f"{len(network.nodes)} nodes merged to {len(chosen.groups)}"
    lines = [f"{network.name} with its {sizes}, by its own run on {learnt}:", f"{_error(chosen.trained)}."]
    if chosen.kept is not None:
        lines.append(f"Mergers chosen on {kept}: {_error(chosen.kept)}.")
    if lost:
        lines.append(f"Left out, as they take away a part of a merged node only: configuration {', '.join(lost)}.")
    lines.append("Nodes that stand for others:")
    for name, members in chosen.groups.items():
        if len(members) > 1:
            followers = ", ".join(_runs([member for member in members if member != name]))
            lines += textwrap.wrap(f"{name}: {followers}", WIDTH, initial_indent="  ", subsequent_indent="    ")
    return "\n".join(lines)


def _error(found: Error) -> str:
    return f"{found.mean_K:.2f} K mean, {found.largest_K:.1f} K at most ({found.worst})"


def _runs(names: Sequence[str]) -> list[str]:
    """`["teeth_1", "teeth_2", "teeth_3", "yoke"]` -> `["teeth_1 to _3", "yoke"]`."""
    runs: list[list[str]] = []
    for name in names:
        stem, _, number = name.rpartition("_")
        before = runs[-1][-1].rpartition("_") if runs else ("", "", "")
        counts = number.isdecimal() and before[2].isdecimal()
        if counts and before[0] == stem and int(before[2]) + 1 == int(number):
            runs[-1].append(name)
        else:
            runs.append([name])
    return [run[0] if len(run) == 1 else f"{run[0]} to _{run[-1].rpartition('_')[2]}" for run in runs]
