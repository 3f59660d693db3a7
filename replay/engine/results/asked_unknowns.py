"""What `replay --unknown` asks the filter to find, from ids of causes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

from replay.engine.frame.observations import Observation
from replay.engine.results.filtered import HEAT_WALK_SHARE, LEAST_NOISE_K, MOST_FACTOR_SD, place_of_loss, unknown_heat
from replay.errors import ReplayDataError
from twin.differences.candidates import sensor_place
from twin.filters.unknowns import Unknown, UnknownBias, UnknownFactor, terms_of
from twin.motor import features
from twin.motor.causes import Cause, groups, parse
from twin.motor.network import Network
from twin.motor.paths import links_with_groups


def asked_unknowns(
    network: Network, causes: Sequence[str], losses: Mapping[str, float], observations: Sequence[Observation]
) -> dict[str, Unknown]:
    """Id of a cause -> the unknown that a filter is to find for it, losses first. `losses`: node -> mean modelled [W].

    `loss.magnet.constant` is a heat beside the modelled one, of any course. `loss.magnet.scale`,
    `conductance.rotor_surface-teeth.scale` or another law of that link is a factor on the coefficients of the motor
    file, at the start within their `sd`. `sensor.teeth.bias` is what a thermometer reads too much, constant and within
    its `bias_sd`. Two places that mirror each other share one factor under their common stem.

    Raises `CauseError` for what is no id, `ReplayDataError` for what no filter finds and for two losses of one node,
    `FrameError` for what the network has not.
    """
    found = {text: _unknown(network, parse(text), losses, observations) for text in causes}
    at = Counter(place for one in found.values() if (place := place_of_loss(one)) is not None)
    twice = [place for place, count in at.items() if count > 1]
    if twice:
        raise ReplayDataError(f"--unknown: two losses at {twice[0]} cannot be told apart: name one of them.")
    return dict(sorted(found.items(), key=lambda item: place_of_loss(item[1]) is None))


def _unknown(
    network: Network, cause: Cause, losses: Mapping[str, float], observations: Sequence[Observation]
) -> Unknown:
    match cause.kind, cause.law:
        case "loss", "constant":
            return unknown_heat(cause.place, losses)
        case ("loss", "scale") | ("conductance", _):
            return _factor(network, cause)
        case "sensor", "bias":
            return _bias(cause, observations)
    raise ReplayDataError(
        f"--unknown {cause}: no filter finds that: give loss.NODE.constant (a heat), loss.NODE.scale, "
        "conductance.A-B.scale or sensor.NODE.bias."
    )


def _factor(network: Network, cause: Cause) -> UnknownFactor:
    ids = [str(Cause(cause.kind, place, cause.law)) for place in _members(network, cause)]
    terms = list(features.terms(network))
    sd = min(max(terms[i].sd for one in ids for i in terms_of(network, one)), MOST_FACTOR_SD)
    return UnknownFactor(ids[0], sd, sd * HEAT_WALK_SHARE, tuple(ids[1:]))


def _members(network: Network, cause: Cause) -> Sequence[str]:
    """The places that an id names: one, or the two that mirror each other where it names their common stem."""
    if cause.kind == "loss":
        return groups(node.name for node in network.nodes).get(cause.place, (cause.place,))
    links = dict(links_with_groups(network, [(link.a, link.b) for link in network.links]))
    return ["-".join(ends) for ends in links.get(cause.place, ())] or [cause.place]


def _bias(cause: Cause, observations: Sequence[Observation]) -> UnknownBias:
    sensors = [o.sensor for o in observations]
    places = {sensor_place(one, sensors): one for one in sensors}
    if cause.place not in places:
        raise ReplayDataError(f"--unknown {cause}: no thermometer is there: there are {', '.join(places)}.")
    sensor = places[cause.place]
    return UnknownBias(sensor.name, max(sensor.bias_sd, LEAST_NOISE_K))
