"""What observed channels other than thermometers measure of a motor, as the bench file says."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from ingest.texts.nearest import hint
from replay.errors import ReplayDataError
from twin.motor.network import Network
from twin.motor.observables import Measurand, Thermometric, copper_slope

if TYPE_CHECKING:
    from ingest.bench.resolving import ResolvedChannel
    from ingest.catalogue.channels import ChannelData

SHAFT = ("torque", "speed")


def measurands(channels: Sequence[ChannelData], network: Network) -> dict[str, Measurand]:
    """Name of each observed channel that is no thermometer -> what it measures. Raises ReplayDataError where the motor
    lacks the place of one, or the session what it has to be compared with."""
    return {
        c.spec.name: _measurand(c.spec, channels, network)
        for c in channels
        if c.spec.role == "observed" and c.spec.quantity != "temperature"
    }


def _measurand(spec: ResolvedChannel, channels: Sequence[ChannelData], network: Network) -> Measurand:
    match spec.quantity:
        case "power":
            for quantity in SHAFT:
                _only_input(spec, quantity, channels)
            return Measurand("power", spec.stored_unit, spec.gain_sd)
        case "heat":
            around = [b.name for b in network.boundaries]
            if spec.node not in around:
                raise ReplayDataError(
                    f'channel "{spec.name}" observes the heat that "{spec.node}" takes, and that is no boundary of '
                    f'motor "{network.name}".{hint(spec.node or "", around)} Correct node in the bench file.'
                )
            return Measurand("heat", spec.stored_unit, spec.gain_sd, boundary=spec.node)
        case _:
            law, referenced = _law(spec, network), spec.reference is not None
            return Measurand(spec.quantity, spec.stored_unit, spec.gain_sd, law=law, referenced=referenced)


def _law(spec: ResolvedChannel, network: Network) -> Thermometric:
    nodes = [node.name for node in network.nodes]
    for place in spec.weights or (spec.node or "",):
        if place not in nodes:
            raise ReplayDataError(
                f'channel "{spec.name}" goes with the temperature of "{place}", and motor "{network.name}" has no '
                f"such node.{hint(place, nodes)} Correct node or weights in the bench file."
            )
    slope = copper_slope(network.copper, spec.reference_degC) if spec.slope_per_K is None else spec.slope_per_K
    return Thermometric(1.0 if spec.reference is None else spec.reference, slope, spec.reference_degC)


def _only_input(spec: ResolvedChannel, quantity: str, channels: Sequence[ChannelData]) -> None:
    found = [c for c in channels if c.spec.quantity == quantity and c.spec.role == "input"]
    if len(found) != 1:
        wanted = f'add a [[channel]] with quantity = "{quantity}"'
        if found:
            wanted = 'set role = "ignored" on all but one of ' + ", ".join(c.spec.name for c in found)
        raise ReplayDataError(
            f'channel "{spec.name}" observes the electrical power, which is compared with shaft power and losses, and '
            f'{len(found) or "no"} channels of this session give {quantity}: {wanted}, or write role = "input".'
        )
