"""What each DC check of one specimen says of the insulation of a network, all checks in one fit.

Every check multiplies the conductances of the insulation (`twin.motor.ageing_law.is_insulation`) by a factor of its
own. Checks may also differ, each with a prior, in where the nodes start, in what radiates and what convects to
boundaries, and in what sensors, currents, boundary temperatures and the logger's clock are off by. Everything else is
the same in all checks: coefficients and capacities about the motor file's, and how much of its neighbours the sensors
of a place follow. So what the file has wrong bends all checks alike, and hardly the course of the factor over them.

The noise of the fit (`twin.fitting.fit`) is broad, as a network of some nodes misfits in its form. That misfit is
nearly the same in every check and no error of the course; so the variance of a check's parameters is

    S = H^-1 (s^2 J' R^-1 J + L) H^-1

with H = J' R^-1 J + L, J their columns, R the noise, L the priors' precision, and s^2 the mean square of the whitened
residuals (sandwich: P. J. Huber, Proc. 5th Berkeley Symp. 1 (1967) 221). How sure the level of all resistances and the
scale of their changes are, which all checks share, is not in it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from twin.differences.everyday import every_neighbour, laws, products_of, starts_and_biases
from twin.fitting import actions
from twin.fitting.actions import Parameter
from twin.fitting.fit import NEAR_ENOUGH, Fit, fit
from twin.fitting.model import Floats, Model, Test
from twin.insulation.check_tests import every_s
from twin.motor.ageing_law import is_insulation
from twin.motor.features import monomials, terms
from twin.motor.network import Network
from twin.motor.paths import terms_of

FACTOR_SD, MOST_FACTOR = 1.0, 3.0  # of the insulation's ln factor
SURFACE_SD = {"radiation": 0.15, "free_convection": 0.1}  # of the logarithms: emissivity from 0.8 to 0.9 is 0.12
PLAIN_SURFACE_SD = 0.2  # of links to boundaries, where none of them has such a law
FREE_SD = 1.0  # of an emissivity that is left free
MOST_SURFACE = 3.0
FILM_PER_K = 0.005  # what a film gains with the temperature beyond its law
LEAST_FILM_PER_K, MOST_FILM_PER_K = -0.008, 0.02
BOUNDARY_K = 0.3
CURRENT_GAIN = 0.0005  # of one check: what is the same in all of them is in the sources
LATE_SHARE = 0.3  # of the time between two samples: a load is switched in between
LINEARISATIONS = 60


@dataclass(frozen=True)
class OverChecks:
    """What the fit says of each check (K,): `resistance` of the insulation's links side by side [K/W], and `ln_sd`, how
    sure its logarithm is beside those of the other checks. `misfit_K`: root mean square of measured less modelled block
    means; `misfit`: that over the widest span of a channel in a check."""

    resistance: Floats
    ln_sd: Floats
    misfit_K: float
    misfit: float
    converged: bool


def insulated(network: Network) -> bool:
    """Whether a network has links from copper to iron."""
    return any(is_insulation(network, link) for link in network.links)


def over_checks(network: Network, tests: Sequence[Test], emissivity_free: bool) -> OverChecks:
    """The insulation of a checked network at each of `tests`, one for each check; channels at different places have
    different names.

    `emissivity_free`: radiation is left free in each check, so that the level of the curves says nothing about the
    surfaces. Raises ValueError where there is no test or no insulation, `DivergedError` where a run leaves the finite
    numbers.
    """
    if not tests or not insulated(network):
        raise ValueError("nothing to estimate: a fit over checks needs a test and a link from copper to iron")
    model = Model(network, tests, tuple(_freedom(network, tests, emissivity_free)))
    found = fit(model, np.zeros(len(model.parameters)), NEAR_ENOUGH, LINEARISATIONS)
    whitened, left = _whitened(found)
    square = float(whitened @ whitened) / whitened.size
    misfit_K = float(np.sqrt(np.mean(left**2)))
    return OverChecks(
        resistance=_resistances(network, tests, found),
        ln_sd=np.array([_own_sd(found, k, square) for k in range(len(tests))]),
        misfit_K=misfit_K,
        misfit=misfit_K / max(_span_K(test) for test in tests),
        converged=found.converged,
    )


def _freedom(network: Network, tests: Sequence[Test], emissivity_free: bool) -> Iterator[Parameter]:
    """The parameters: the factor of each check, the coefficients, then everything else."""
    own = tuple(_insulation(network))
    for k in range(len(tests)):
        yield Parameter("insulation", actions.Scale(own), FACTOR_SD, k, -MOST_FACTOR, MOST_FACTOR)
    yield from laws(network)
    for channel in {c.name: c for test in tests for c in test.channels}.values():
        yield from (one for one, _ in every_neighbour(network, channel))
    yield from _films(network, tests)
    surfaces = _surfaces(network)
    free = next(iter(surfaces), None) if emissivity_free else None  # radiation, where there is some
    for k, test in enumerate(tests):
        for law, places in surfaces.items():
            sd = FREE_SD if law == free else SURFACE_SD.get(law, PLAIN_SURFACE_SD)
            yield Parameter(f"surface.{law}", actions.Scale(places), sd, k, -MOST_SURFACE, MOST_SURFACE)
        yield from _of_check(network, test, k)


def _insulation(network: Network) -> Iterator[int]:
    links, _ = terms_of(network)
    for link in network.links:
        if is_insulation(network, link):
            yield from links[link.a, link.b]


def _surfaces(network: Network) -> dict[str, tuple[int, ...]]:
    """Law -> terms of all links to a boundary, radiation first. Terms without a law are left out as paths through
    solids; where no link has a law they stand for the surfaces, under "plain"."""
    outside, links = {boundary.name for boundary in network.boundaries}, terms_of(network)[0]
    found: dict[str, tuple[int, ...]] = dict.fromkeys((*SURFACE_SD, "plain"), ())
    for link in network.links:
        if outside & {link.a, link.b}:
            for place, term in zip(links[link.a, link.b], link.terms, strict=True):
                law = term.law or "plain"
                found[law] = (*found[law], place)
    lawful = any(found[law] for law in SURFACE_SD)
    return {law: places for law, places in found.items() if places and (law != "plain" or not lawful)}


def _films(network: Network, tests: Sequence[Test]) -> Iterator[Parameter]:
    """Films may rise more or less with the temperature than the file says: their laws are fits, and where the file has
    none a constant stands for film and radiation."""
    films = {i for law, own in _surfaces(network).items() if law != "radiation" for i in own}
    reference = float(np.mean([test.frame.boundaries.mean() for test in tests]))
    places, members = [], []
    for (a, b), own in terms_of(network)[0].items():
        if films & set(own):
            places.append(actions.Place(*sorted(network.names.index(end) for end in (a, b))))
            members.append(tuple(i for i in own if i in films))
    if places:
        tilt = actions.Tilt(tuple(places), tuple(members), (reference,) * len(places))
        yield Parameter("film", tilt, FILM_PER_K, low=LEAST_FILM_PER_K, high=MOST_FILM_PER_K)


def _of_check(network: Network, test: Test, k: int) -> Iterator[Parameter]:
    yield from starts_and_biases(network, test, k)
    for b, boundary in enumerate(network.boundaries):
        yield Parameter(f"boundary.{boundary.name}.bias", actions.BoundaryBias(b), BOUNDARY_K, k)
    for name in sorted({name for m in monomials(network) for name in m.features if name.startswith("current")}):
        yield Parameter(f"input.{name}.gain", actions.InputGain(name), CURRENT_GAIN, k)
    late = actions.Late(tuple(channel.name for channel in test.channels), False)
    yield Parameter("late", late, LATE_SHARE * every_s(test), k)


def _whitened(found: Fit) -> tuple[Floats, Floats]:
    """The residuals of all channels, under the noise and as they are."""
    white = [found.model.whitened(series, series.y[:, None])[:, 0] for series in found.series]
    return np.concatenate(white), np.concatenate([series.y for series in found.series])


def _span_K(test: Test) -> float:
    return max(float(np.ptp(channel.measured[channel.samples > 0.0])) for channel in test.channels)


def _own_sd(found: Fit, k: int, square: float) -> float:
    """Standard deviation of the ln factor of check k, which is the first of its parameters."""
    own = [i for i, parameter in enumerate(found.model.parameters) if parameter.test == k]
    hessian, prior = found.hessian[np.ix_(own, own)], np.diag(found.model.sd[own] ** -2.0)
    inverse = np.linalg.inv(hessian)
    return float(np.sqrt((inverse @ (square * (hessian - prior) + prior) @ inverse)[0, 0]))


def _resistances(network: Network, tests: Sequence[Test], found: Fit) -> Floats:
    """Resistance of the insulation at each check (K,) [K/W]: of the mean conductance over all tests with the fitted
    coefficients, times the check's factor."""
    mean = np.mean(np.concatenate([test.frame.features for test in tests]), axis=0, keepdims=True)
    products, shared, listed = products_of(network, mean), found.beta[len(tests) :], list(terms(network))
    conductance = sum(
        listed[i].coefficient * float(products[i][0]) * float(np.exp(shared[i])) for i in _insulation(network)
    )
    return np.asarray(np.exp(-found.beta[: len(tests)]) / conductance)
