"""What stands beside the lines of a session: zero and the sensor's own band under its residuals, where the motor turned
and what its state channels said, and which samples are not used. `zero` [ns]: the stamp that counts as 0."""

from __future__ import annotations

import numpy as np

from ingest.catalogue.channels import ChannelData
from replay.engine.results.run import Observed
from replay.show.viewer.layer_file import LayerFile
from replay.show.viewer.seen import GUIDE, path
from replay.show.words import words
from replay.show.words.palette import SERIES

ZERO_WIDTH, BAND_WIDTH = 1.5, 0.8
STILL = 0.01  # of the highest speed: below it a motor stands
PHASES = {"turns": SERIES["sky"][0], "stands": GUIDE}
MASKED = {"used": GUIDE, "masked": SERIES["yellow"][0]}
PHASE_S = 10.0  # shorter standstills and turns are not told


def band(to: LayerFile, o: Observed, *whose: str, zero: int = 0) -> None:
    """Zero and the sensor's own band, at `band/<node>/<whose>/<channel>`."""
    ends = o.t_ns[[0, -1]] - zero
    for name, value in {"zero": 0.0, "from": -o.floor_K, "to": o.floor_K}.items():
        says = "zero" if name == "zero" else f"{o.channel}'s own uncertainty"
        width = ZERO_WIDTH if name == "zero" else BAND_WIDTH
        to.line(path("band", o.node, *whose, o.channel, name), says, GUIDE, width, ends, np.full(2, value))


def masked(to: LayerFile, o: Observed, whose: str, zero: int = 0) -> None:
    """The stretches of samples that are not used, at `masked/<whose>/<channel>`; nothing where all are."""
    if not o.used.all():
        changes = np.flatnonzero(np.r_[True, np.diff(o.used)])
        states = ["used" if o.used[i] else "masked" for i in changes]
        to.states(path("masked", whose, o.channel), o.t_ns[changes] - zero, states, MASKED)


def phases(to: LayerFile, channel: ChannelData, *whose: str, zero: int = 0) -> None:
    """What a state channel says, at `phase/<whose>/<channel>`, and of the speed where the motor turned and where it
    stood, at `phase/<whose>/motor`; nothing of others."""
    spec = channel.spec
    if spec.quantity == "state":
        changes = np.flatnonzero(np.r_[True, np.diff(channel.value) != 0])
        states = [words.number(value) for value in channel.value[changes]]
        to.states(path("phase", *whose, spec.name), channel.t_ns[changes] - zero, states)
    elif spec.quantity == "speed" and spec.role == "input":
        turns = np.abs(channel.value) > STILL * np.abs(channel.value).max(initial=1.0)
        changes = np.flatnonzero(np.r_[True, np.diff(turns)])
        lasts = np.diff(np.r_[channel.t_ns[changes], channel.t_ns[-1]]) / 1e9
        kept = changes[(lasts >= PHASE_S) | (changes == 0)]
        told = kept[np.r_[True, np.diff(turns[kept].astype(int)) != 0]]
        states = ["turns" if turns[i] else "stands" for i in told]
        to.states(path("phase", *whose, "motor"), channel.t_ns[told] - zero, states, PHASES)
