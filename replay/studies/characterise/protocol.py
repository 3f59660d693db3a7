"""The paper's protocol over stored sessions: influence on drive cycles, fit on S1 and S2, check and filter on drive
cycles.

The template is checked, every coefficient and capacity is weighed by what it moves on the drive cycles, the most
influential ones are fitted to the S1 and S2 points, and the drive cycles, from which nothing was learnt, are replayed
with the model before and after, the filter beside it (sections 3.1 and 4.2 of the paper). Which points taught most, and
which to run next, is asked of the fitted model.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ingest.facts.events import SessionRecorded
from ingest.facts.facts import Facts
from ingest.facts.store import Store
from replay.engine.files.configurations import refuse_other_rigs
from replay.engine.files.motor_file import read_motor
from replay.engine.results.summary import Summary, read
from replay.engine.runs.campaign import replay_sessions
from replay.errors import ReplayDataError
from replay.studies.characterise.calibrate import CalibrationResult, calibrate_sessions, common_model
from replay.studies.motors.new import DEFAULT, TOPOLOGIES
from replay.studies.sessions.fitting import fitting
from replay.studies.sessions.recorded import test_of
from twin.calibration.influence import Influence, influence
from twin.calibration.point_choice import Choice, in_order, information, known_K, prior
from twin.diagnosis.next_tests import as_test, menu
from twin.fitting.model import Test
from twin.fitting.noise import ChannelNoise
from twin.motor.configured import configured
from twin.motor.network import Network
from twin.run.describe import describe

POINTS, DRIVES = ("s1", "s2"), ("wltp", "drive")  # kinds that are learnt from, and that the model is checked on
MOVES_K = 0.1  # what one prior sd of a parameter must move at some node on the drive cycles: below, no sensor sees it

Floats = NDArray[np.float64]
Tell = Callable[[str], None]


@dataclass(frozen=True)
class Proposal:
    """A test that was not run: in words, what it adds to all that were and to the proposals before it [nats], its
    length [h], and `known_K` (n,) what the parameters leave unknown of each node on the drives after it."""

    words: str
    gain: float
    hours: float
    known_K: Floats


@dataclass(frozen=True)
class Protocol:
    """`warnings`: what `motor check` says of the motor file; `fitted`: names of the parameters that moved; `choices`:
    of `points`, in the order in which they teach; `unknown_K` (n,): what the parameters leave unknown of each node on
    the drives before anything is learnt; `proposals`: tests that were not run, in the order in which they would teach
    most an hour; `before`, `after`: summaries of the drives' replays with the parent and with the fitted model."""

    network: Network
    warnings: tuple[str, ...]
    points: tuple[SessionRecorded, ...]
    drives: tuple[SessionRecorded, ...]
    influence: Influence
    fitted: tuple[str, ...]
    calibration: CalibrationResult
    choices: tuple[Choice, ...]
    unknown_K: tuple[float, ...]
    proposals: tuple[Proposal, ...]
    before: tuple[Summary, ...]
    after: tuple[Summary, ...]


def run_protocol(
    store: Store, facts: Facts, sessions: Sequence[SessionRecorded], model: str | None, level: str, tell: Tell
) -> Protocol:
    """Run the protocol over sessions. The fitted model is published as `calibrate` does, the replays are facts as
    those of `replay`.

    Raises ReplayDataError where there is no S1 or S2 session, no drive cycle, no motor file, or a session lacks what
    the model needs.
    """
    refuse_other_rigs(sessions)
    points, drives = by_kind(sessions)
    parent = model or _named_model(facts, [*points, *drives])
    motor = read_motor(store.archive.read(parent), facts.models[parent].file)
    network, warnings = configured(motor, None), describe(motor).warnings
    tell("reading the sessions")
    of_drives = [test_of(store, facts, session, network, (), level) for session in drives]
    with fitting(f"protocol of {network.name}"):
        tell("weighing the parameters on the drive cycles")
        weighed = influence(network, of_drives)
        by_influence = weighed.order(range(len(network.nodes)))
        names = [weighed.parameters[i].name for i in by_influence if weighed.per_sd_K[i].max() >= MOVES_K]
        if not names:
            raise ReplayDataError(
                f"nothing in {network.name} moves a node by {MOVES_K} K on {_named(drives)}: there is nothing to fit."
            )
        tell(f"fitting {len(names)} of {len(weighed.parameters)} parameters to {_named(points)}")
        calibration = calibrate_sessions(store, facts, points, parent, level, names, tell)
        tell("weighing the points")
        fitted = calibration.calibration
        noise = fitted.fit.model.noise
        after_fit = influence(fitted.network, of_drives)
        # Gains of meters are no parameter of the motor.
        of_points = [replace(test, meters=()) for test in calibration.tests]
        taught = [information(fitted.network, test, noise) for test in of_points]
        choices = in_order(taught, after_fit)
        proposals = _proposals(fitted.network, of_points, noise, np.sum(taught, axis=0), after_fit)
        unknown_K = known_K(prior(after_fit.parameters), after_fit)
    before, after = (_replayed(store, drives, one, level, tell) for one in (parent, calibration.event.model))
    return Protocol(
        network=network,
        warnings=warnings,
        points=points,
        drives=drives,
        influence=weighed,
        fitted=tuple(names),
        calibration=calibration,
        choices=tuple(choices),
        unknown_K=tuple(unknown_K.tolist()),
        proposals=proposals,
        before=before,
        after=after,
    )


def template_needed(why: str) -> ReplayDataError:
    """The refusal where there is no motor file to begin with; it says how to get one."""
    return ReplayDataError(
        f"{why}: the protocol begins with a template. Write one with `whyhot motor new --topology {DEFAULT} -o "
        f"motor.toml` (or of {', '.join(t for t in TOPOLOGIES if t != DEFAULT)}), put your motor's numbers in, "
        "`whyhot motor check motor.toml`, and say --model motor.toml."
    )


def _named_model(facts: Facts, sessions: Sequence[SessionRecorded]) -> str:
    """The model that the sessions' bench files name."""
    for session in sessions:
        bench = facts.bench_of(session)
        if bench is not None and bench.model is None:
            raise template_needed(f"session {session.name}: {bench.name} names no motor file")
    return common_model(facts, sessions)


def by_kind(sessions: Sequence[SessionRecorded]) -> tuple[tuple[SessionRecorded, ...], tuple[SessionRecorded, ...]]:
    """The sessions to learn from and those to check on. Raises ReplayDataError where either is missing, or a session
    is neither."""
    points, drives = (tuple(s for s in sessions if s.kind in kinds) for kinds in (POINTS, DRIVES))
    if other := [s for s in sessions if s not in points and s not in drives]:
        raise ReplayDataError(
            f"{_named(other)}: of kind {other[0].kind}: the protocol learns from S1 and S2 and checks on drive cycles. "
            "Leave it out, or say its kind with `kind = ...` in the bench file."
        )
    for found, kind, why in ((points, "S1 or S2 session", "to fit to"), (drives, "drive cycle", "to check on")):
        if not found:
            raise ReplayDataError(
                f"no {kind} among those named: add one {why} with --on. `whyhot sessions` lists kinds."
            )
    return points, drives


def of_interest(network: Network) -> list[int]:
    """Indices of the nodes that a motor's limits are about: windings and magnets; of all where there are none."""
    found = [i for i, node in enumerate(network.nodes) if node.region in ("copper", "magnet")]
    return found or list(range(len(network.nodes)))


def _proposals(
    network: Network, tests: Sequence[Test], noise: Mapping[str, ChannelNoise], taught: Floats, drives: Influence
) -> tuple[Proposal, ...]:
    """The tests of the menu, each the one that adds most an hour to what the recorded ones and those before it
    teach."""
    offered = menu(network, tests)
    hours = [len(one.speed) * tests[0].frame.step_s / 3600 for one in offered]
    would_teach = [information(network, as_test(network, tests, one), noise) for one in offered]
    chain = in_order(would_teach, drives, prior(drives.parameters) + taught, hours)
    return tuple(Proposal(offered[c.test].words, c.gain, hours[c.test], c.known_K) for c in chain)


def _replayed(
    store: Store, drives: Sequence[SessionRecorded], model: str, level: str, tell: Tell
) -> tuple[Summary, ...]:
    outcomes = replay_sessions(store, drives, model, level, tell=tell)
    if refusals := [outcome.refusal for outcome in outcomes if outcome.refusal]:
        raise ReplayDataError(refusals[0])
    return tuple(read(outcome.run.summary) for outcome in outcomes if outcome.run)


def _named(sessions: Sequence[SessionRecorded]) -> str:
    return ", ".join(session.name for session in sessions)
