"""Logs of one session that say other things of one channel at the same time: two motors, two tests, or a clock that is
far off."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray

from ingest.catalogue.at_once import goes_on
from ingest.catalogue.channels import ChannelData, step_of
from ingest.catalogue.quality import noise_of
from ingest.facts.events import QualityFlagged

LEAST = 20  # samples at the same time
FAR = 10.0  # times the noise, or the step where that is larger, in the median of all samples
SHARE = 0.02  # and of the channel's largest magnitude
NAMED = 3  # channels; more are counted


def contradicting(channels: Sequence[ChannelData], name_of: Callable[[str], str]) -> list[QualityFlagged]:
    """One flag for every two logs with channels that both hold at the same time, with other values. `name_of`: SHA-256
    -> the log's name."""
    apart: defaultdict[tuple[str, str], list[tuple[ChannelData, float, float]]] = defaultdict(list)
    for channel in channels:
        if channel.spec.role != "ignored":
            for pair, one, other in _apart(channel):
                apart[pair].append((channel, one, other))
    return [_flag(" and ".join(map(name_of, pair)), found) for pair, found in apart.items()]


def _flag(logs: str, found: Sequence[tuple[ChannelData, float, float]]) -> QualityFlagged:
    values = [f"{c.spec.name} {one:.4g} and {other:.4g} {c.unit or ''}".rstrip() for c, one, other in found[:NAMED]]
    more = f", and {len(found) - NAMED} more" if len(found) > NAMED else ""
    says = (
        f"{logs} hold other values of the same channels at the same time (in the median {', '.join(values)}{more}): "
        "one is of another motor or test, or its clock is off. `whyhot correct LOG --specimen S` or "
        "`whyhot retract LOG` takes it out of this session"
    )
    return QualityFlagged(flag="contradiction", says=says, detail={"channels": [c.spec.name for c, _, _ in found]})


def _apart(channel: ChannelData) -> Iterator[tuple[tuple[str, str], float, float]]:
    """Every log that counts and one beside it that are far apart where both have samples, with their medians there."""
    if channel.beside is None:
        return
    for a, b in product(np.unique(channel.raw).tolist(), np.unique(channel.beside.raw).tolist()):
        one = channel.samples(channel.raw == a)
        other = channel.beside.samples(channel.beside.raw == b)
        there = goes_on(one.t_ns, other.t_ns)
        if a != b and there.sum() >= LEAST:
            seen = other.value[there]
            meanwhile = np.interp(other.t_ns[there], one.t_ns, one.value)
            most = max(float(np.abs(part.value).max()) for part in (channel, channel.beside))
            least = max(FAR * max(_fine(one.value), _fine(seen)), SHARE * most)
            if np.median(np.abs(seen - meanwhile)) > least:
                yield (channel.raws[a], channel.raws[b]), float(np.median(meanwhile)), float(np.median(seen))


def _fine(value: NDArray[np.float64]) -> float:
    """The noise of a channel in one log, or its step."""
    return max(noise_of(value) or 0.0, step_of(value) or 0.0)
