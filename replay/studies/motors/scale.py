"""Motor files of another size, or cut along the stack, made from one that is there."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from replay.engine.files.motor_file import SCALES, read_motor
from replay.engine.files.motor_text import written
from replay.engine.files.network_text import network_text
from replay.engine.files.toml_edit import edited
from twin.motor.network import Network
from twin.motor.scaling import scaled
from twin.motor.slicing import sliced

WIDTH = 116  # characters of a comment
_BOM = "\ufeff"


def scaled_file(data: bytes, name: str, length: float) -> bytes:
    """The motor file `data`, which messages call `name`, with every length times `length`: its numbers are replaced
    where they stand.

    Raises MotorFileError as `read_motor`, `twin.errors.BadValueError` for a length that leaves no similarity.
    """
    before = read_motor(data, name)
    after = scaled(before, length)
    after = replace(after, scale={quantity: float(f"{value:.7g}") for quantity, value in after.scale.items()})
    headed = edited(data.decode().removeprefix(_BOM), _head(before), _head(after), "").encode()
    says = (
        f"Scaled from {before.name}: every length times {length:g}, materials, turns, poles and speed as they were.\n"
        f"At features of 1: capacities times {length**3:.4g}, conduction {length:.4g}, "
        f"films {length**2:.4g}; copper DC loss\n"
        f"{length:.4g}, AC and magnet losses {length**5:.4g}, "
        f"iron and all other losses {length**3:.4g}. Each sd is wider.\n"
        "Comments beside a number speak of its value before."
    )
    return written(headed, name, after, says)


def _head(network: Network) -> dict[str, Any]:
    """The keys that `written` leaves as they are: name and scales."""
    keys = {quantity: key for key, quantity in SCALES.items()}
    scale = {"scale": {keys[quantity]: value for quantity, value in network.scale.items()}} if network.scale else {}
    return {"name": network.name, **scale}


def sliced_file(data: bytes, name: str, nodes: Sequence[str], slices: int, length_m: float) -> tuple[bytes, Network]:
    """A new motor file: `nodes` of the motor cut into slices along its stack [m]; and its network.

    Raises MotorFileError as `read_motor`, and what `twin.motor.slicing.sliced` does.
    """
    before = read_motor(data, name)
    cut = sliced(before, nodes, slices, length_m)
    command = (
        f"`whyhot motor slice {name} --into {slices} --stack-mm {length_m * 1000:g} --nodes {' '.join(nodes)} -o OUT`"
    )
    says = (
        f"{before.name}, its stack cut into slices from end a to end b by\n"
        f"{textwrap.fill(command, WIDTH, subsequent_indent='  ', break_on_hyphens=False)}\n"
        "The middle slice of each keeps the node's name. Sums of capacities, "
        "losses and conductances are those of the motor."
    )
    return network_text(cut, says), cut
