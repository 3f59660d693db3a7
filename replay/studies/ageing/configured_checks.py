"""DC checks through the motor file: the rig is a configuration of the motor, and its insulation is estimated in that
network.

Where the bench file of a specimen's checks names a configuration, all its checks are fitted together
(`twin.insulation.insulation_fit`), by the first of three routes that serves: with the sensors on the iron; without
these, the first minutes after the load is switched on and off; the whole curves with the emissivity of each check
left free. Where none serves, the routes that know no motor file do what they can.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from ingest.catalogue.channels import ChannelData
from ingest.facts.events import SessionRecorded
from ingest.facts.facts import Facts
from ingest.facts.store import Store
from replay.engine.files.configurations import network_of
from replay.engine.files.models import model_of
from replay.errors import ReplayDataError
from replay.studies.ageing.dc_checks import trace_of
from replay.studies.sessions.fitting import fitting
from replay.studies.sessions.recorded import test_of
from twin.errors import TwinError
from twin.fitting.model import Test
from twin.insulation.check_tests import (
    begun_alike,
    by_place,
    coarse,
    every_s,
    iron_moved,
    load,
    minutes_of_switches,
    of_iron,
    without_iron,
)
from twin.insulation.insulation_fit import insulated, over_checks
from twin.motor.network import Network

if TYPE_CHECKING:
    from analytics.insulation.checks.estimate import ResistanceEstimate
    from analytics.insulation.checks.resistance import CheckResistance, CheckTrace, Together

IRON, MINUTES, AMBIENT = "iron sensor", "first minutes", "ambient"
LEAST_LOAD_S = 1200.0
SWITCH_MIN = 20.0  # after a switch, that count as its first minutes
MOST_EVERY_S = 60.0  # between two samples of these minutes
MOST_MISFIT = 0.01  # of the temperatures' span, that a network may be off: more is another machine


@dataclass(frozen=True)
class LoggedCheck:
    """A check as its log gives it. `test` is the same in `network`, its motor in the `configuration` that its bench
    file names; both are None where it names none, and where it cannot be run so: then `why` says why."""

    trace: CheckTrace
    configuration: str | None = None
    network: Network | None = None
    test: Test | None = None
    why: str | None = None


def logged_check(
    store: Store, facts: Facts, session: SessionRecorded, channels: Sequence[ChannelData], motor: str | None
) -> LoggedCheck:
    """The check of a session with these channels; `motor`: the model (SHA-256 of a motor file) to evaluate it
    through, None: the one that its bench file names."""
    trace = trace_of(channels)
    if session.configuration is None:
        return LoggedCheck(trace)
    try:
        network = network_of(store, facts, session, motor or model_of(facts, session))
        if not insulated(network):
            return LoggedCheck(trace, session.configuration, why=f"{network.name} has no link from copper to iron")
        test = test_of(store, facts, session, network, (), "testing", loaded=channels)
    except (ReplayDataError, TwinError) as error:
        why = str(error).removeprefix(f"session {session.name}: ").removesuffix(".")
        return LoggedCheck(trace, session.configuration, why=why)
    return LoggedCheck(trace, session.configuration, network, coarse(test))


def models_of(facts: Facts, sessions: Sequence[SessionRecorded]) -> list[str | None]:
    """The model of each session's configuration, None where it has none: part of what an answer depends on."""
    found: list[str | None] = []
    for session in sessions:
        bench = facts.bench_of(session) if session.configuration is not None else None
        found.append(facts.current(bench.model) if bench is not None and bench.model is not None else None)
    return found


def evaluate_checks(checks: Sequence[LoggedCheck]) -> tuple[tuple[CheckResistance, ...], list[str]]:
    """The checks of one specimen in the order of time, comparable with each other, and what a person should know: why
    a named configuration was not used."""
    from analytics.insulation.checks.resistance import evaluate_together

    if not checks:
        return (), []
    rig = Rig.of(checks)
    answers = evaluate_together([check.trace for check in checks], [] if rig is None else rig.routes())
    named = next((check.configuration for check in checks if check.configuration), None)
    if named is None or any(answer.source and named in answer.source for answer in answers):
        return answers, []
    reasons = rig.reasons if rig else Counter(check.why for check in checks if check.why)
    most = [why for why, _ in reasons.most_common(3)]
    return answers, [f'its checks are evaluated without configuration "{named}": {"; ".join(most)}.']


@dataclass
class Rig:
    """The checks of one specimen in the network that most of them share."""

    checks: Sequence[LoggedCheck]
    configuration: str
    network: Network
    reasons: Counter[str] = field(default_factory=Counter)  # why a route did not serve a check

    @classmethod
    def of(cls, checks: Sequence[LoggedCheck]) -> Rig | None:
        """The checks in that network; None where no check has one."""
        there = [check for check in checks if check.network is not None]
        if not there:
            return None
        best = max(there, key=lambda check: sum(other.network == check.network for other in there))
        assert best.configuration is not None and best.network is not None
        return cls(checks, best.configuration, best.network)

    def routes(self) -> list[Together]:
        """The routes in order of trust."""
        from analytics.insulation.checks.resistance import Together

        return [
            Together(f"{route}, configuration {self.configuration}", partial(self._estimates, route))
            for route in (IRON, MINUTES, AMBIENT)
        ]

    def _estimates(self, route: str, left_out: Sequence[Mapping[str, str]]) -> list[ResistanceEstimate | str]:
        """The resistance of each check by one fit of all that the route serves, or why it does not."""
        from analytics.insulation.checks.routes import too_wide

        moved = self._iron_off_by(left_out)
        tests = [self._test(route, *one) for one in zip(self.checks, left_out, moved, strict=True)]
        fitted = iter(self._fit(route, [test for test in tests if isinstance(test, Test)]))
        answers = [test if isinstance(test, str) else next(fitted) for test in tests]
        for answer in answers:
            why = answer if isinstance(answer, str) else too_wide(answer)
            if why is not None:
                self.reasons[f"{route}: {why}"] += 1
        return answers

    def _iron_off_by(self, left_out: Sequence[Mapping[str, str]]) -> list[float]:
        """By how much the iron's sensors of each check have to be moved [K]: read before the load, as for every
        route."""
        from analytics.insulation.checks.zero import of_one_zero

        traces = [check.trace for check in self.checks]
        moved = of_one_zero(traces, left_out)
        differences = (new.iron_degC - old.iron_degC for new, old in zip(moved, traces, strict=True))
        return [float(np.nanmean(by)) if np.isfinite(by).any() else 0.0 for by in differences]

    def _test(self, route: str, check: LoggedCheck, left_out: Mapping[str, str], iron_K: float) -> Test | str:
        """What of a check enters the fit, or why nothing does."""
        if check.test is None:
            return check.why or "its bench file names no configuration"
        if check.network != self.network:
            return "it is of another configuration or motor file than most: say one with --motor"
        test = iron_moved(self.network, by_place(check.test, left_out), iron_K)
        if route == IRON and not any(of_iron(self.network, channel) for channel in test.channels):
            return "no channel follows iron"
        if route != IRON:
            test = without_iron(self.network, test)
        if not test.channels:
            return "no temperature of a node that can be believed"
        on = load(self.network, test)
        if on is None:
            return "no load: nothing heats the copper"
        test = begun_alike(self.network, test)
        if route == MINUTES:
            cut = minutes_of_switches(self.network, test, SWITCH_MIN) if every_s(test) <= MOST_EVERY_S else None
            return cut or (
                f"fewer than {SWITCH_MIN:.0f} min recorded after switching on and off, or samples more than "
                f"{MOST_EVERY_S:.0f} s apart"
            )
        loaded_s = (on[1] - on[0] + 1) * test.frame.step_s
        if loaded_s < LEAST_LOAD_S:
            return (
                f"loaded for {loaded_s // 6.0 / 10.0:.1f} min without a break, {LEAST_LOAD_S / 60.0:.0f} min are needed"
            )
        return test

    def _fit(self, route: str, tests: Sequence[Test]) -> Sequence[ResistanceEstimate | str]:
        """The resistance of each test by one fit of all, or why it is not known."""
        from analytics.insulation.checks.estimate import ResistanceEstimate

        if not tests:
            return []
        try:
            with fitting(f"configuration {self.configuration}"):
                found = over_checks(self.network, tests, emissivity_free=route == AMBIENT)
        except ReplayDataError as error:
            return [str(error)] * len(tests)
        if not found.converged:
            return ["the fit of all checks did not converge"] * len(tests)
        if found.misfit > MOST_MISFIT:
            off = f"the network misses the measured temperatures by {found.misfit_K:.1f} K (rms)"
            return [f"{off} whatever its coefficients: correct the motor file"] * len(tests)
        both = zip(found.resistance.tolist(), found.ln_sd.tolist(), strict=True)
        return [ResistanceEstimate(value, value * ln_sd) for value, ln_sd in both]
