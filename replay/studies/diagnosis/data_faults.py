"""Faults of the data themselves: held, stuck, saturated and lost samples, weighed as causes. Where a whole record
repeats, no sensor has a fault."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ingest.catalogue import quality
from ingest.catalogue.channels import ChannelData
from twin.diagnosis.faults import Stretch, cause_of, dropout_evidence, fault_evidence
from twin.differences.candidates import sensor_place
from twin.fitting.fit import Fit
from twin.motor.causes import Cause
from twin.motor.sensor import Sensor

LOST = 1.5  # median intervals from which on a gap is a lost sample


@dataclass(frozen=True)
class DataFault:
    """A fault of a channel over all training sessions. `masked_share`: of its samples; `says`, one line a session that
    shows it: index of the session -> words."""

    cause: Cause
    channel: str
    log_bayes_factor: float
    masked_share: float
    says: dict[int, str]


def data_faults(
    current: Fit, loaded: Sequence[Sequence[ChannelData]], observed: Sequence[Sensor], threshold: float
) -> list[DataFault]:
    """The faults with more evidence than the threshold, clearest first; `loaded`: the channels of each session."""
    names = {c.name: c for c in observed}
    evidence: defaultdict[tuple[str, str], float] = defaultdict(float)
    lines: defaultdict[tuple[str, str], dict[int, str]] = defaultdict(dict)
    shares: defaultdict[tuple[str, str], list[float]] = defaultdict(list)
    for s, channels in enumerate(loaded):
        for channel, found in zip(channels, quality.assess(channels), strict=True):
            used = {c.name for c in current.model.tests[s].channels}  # a sensor that is stuck throughout is left out
            if channel.spec.name not in names or channel.spec.name not in used or not len(channel.t_ns):
                continue
            for kind, value, words, share in _weighed(current, s, channel, found):
                key = (channel.spec.name, kind)
                evidence[key] += value
                lines[key][s] = words
                shares[key].append(share)
    result = [
        DataFault(
            cause=cause_of(sensor_place(names[channel], observed), kind),
            channel=channel,
            log_bayes_factor=value,
            masked_share=float(np.mean(shares[channel, kind])),
            says=lines[channel, kind],
        )
        for (channel, kind), value in evidence.items()
        if value > threshold
    ]
    return sorted(result, key=lambda fault: -fault.log_bayes_factor)


def _weighed(
    current: Fit, s: int, channel: ChannelData, found: quality.ChannelQuality
) -> Iterator[tuple[str, float, str, float]]:
    """(kind, ln evidence, words, share of samples) of what one channel of one session shows."""
    name, start_ns = channel.spec.name, current.model.tests[s].start_ns
    t_s = (channel.t_ns - start_ns) / 1e9
    for kind in ("held", "stuck", "saturated"):
        some = [one for one in found.stretches if one.kind == kind and not one.together]
        if some:
            at_s = [((x.start_ns - start_ns) / 1e9, (x.end_ns - start_ns) / 1e9) for x in some]
            stretches = [Stretch(kind, *ends, x.value) for ends, x in zip(at_s, some, strict=True)]
            value = fault_evidence(current, s, name, stretches, t_s, channel.value)
            masked = sum(x.last - x.first + 1 for x in some) / len(channel.t_ns)
            longest = quality.seconds(max(x.duration_s for x in some))
            times = f"up to {longest}, {len(some)} times" if len(some) > 1 else longest
            yield kind, value, f"{kind} for {times}: masked", masked
    interval = np.diff(channel.t_ns)
    lost = int((interval > LOST * channel.median_ns).sum())
    yield "dropout", dropout_evidence(len(channel.t_ns), lost), f"{lost:,} samples are missing one by one", 0.0
