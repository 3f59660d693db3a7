"""What the catalogue sees of a session: its channels and their quality.

A session of more samples than memory should hold is looked through in parts, one after the other in time. Ten minutes
on either side are read with each part, so that a stretch that ends beside its border is judged as in the whole; what
goes on over a border is joined. Of the channels that a motor is driven by, means of a second stay, of the others means
of ten seconds (of longer ones where even these would be too many); everything else is told of all samples.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ingest.bench.resolving import ResolvedChannel
from ingest.catalogue import quality
from ingest.catalogue.channels import MOST_VALUES, Array, ChannelData, load, load_within
from ingest.catalogue.decoded import DecodedFile, files_of
from ingest.catalogue.quality import STUCK_NS, WINDOW_NS, ChannelQuality, Lapse, RepeatedSamples
from ingest.facts.events import SessionRecorded
from ingest.facts.facts import Facts
from ingest.facts.standing import runs

if TYPE_CHECKING:
    from ingest.facts.store import Store

SECOND_NS = 1_000_000_000
FINE_s, COARSE_s = 1, 10
BESIDE = 0.1  # of a part: what is read on either side of it at most
POWERS = ("power", "voltage_d", "voltage_q", "voltage_dc")
DRIVE = ("speed", "torque", "current", "current_d", "current_q", "current_dc", *POWERS)  # what drives a motor

Ints = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Looked:
    """A session looked through: a quality a channel, told of all samples; `good` is empty where it was in parts."""

    channels: Sequence[ChannelData]
    qualities: Sequence[ChannelQuality]


def looked(channels: Sequence[ChannelData]) -> Looked:
    """A session of which memory holds all samples."""
    ends = [_End(one.raws[one.raw[-1]], int(one.t_ns[-1])) if len(one.t_ns) else None for one in channels]
    return Looked(channels, _to_the_end(quality.assess(channels), ends))


@dataclass(frozen=True)
class _End:
    """The last stamp [ns] of a channel, and the file that it is from."""

    raw: str
    t_ns: int


def _to_the_end(qualities: Sequence[ChannelQuality], ends: Sequence[_End | None]) -> list[ChannelQuality]:
    """The qualities with the gap of a channel that came to its end before others of its file, as of a thermocouple that
    goes open and stays so."""
    last: dict[str, int] = {}
    for each in (end for end in ends if end is not None):
        last[each.raw] = max(each.t_ns, last.get(each.raw, each.t_ns))
    found = []
    for one, end in zip(qualities, ends, strict=True):
        stamps = np.array([end.t_ns, last[end.raw]] if end else [], np.int64)
        silent = quality.gaps_of(stamps, 1e9 / one.rate_Hz) if one.rate_Hz else ()
        found.append(replace(one, gaps=(*one.gaps, *silent)))
    return found


def look(store: Store, facts: Facts, session: SessionRecorded) -> Looked:
    """Look through a session, however long. Raises DamageError where samples are damaged or missing."""
    if is_long(facts, session):
        return in_parts(store, facts, session, MOST_VALUES)
    return looked(load(store, facts, session))


def is_long(facts: Facts, session: SessionRecorded) -> bool:
    """Whether a session has more values than are held at once."""
    return sum(_values(facts, file) for file in session.files) > MOST_VALUES


def _values(facts: Facts, file: Mapping[str, Any]) -> int:
    records = sum(last - first + 1 for first, last in runs(file))
    return sum(
        min(int(group["rows"]), records) * len(group["columns"]) for group in facts.decodes[file["decode"]].groups
    )


def in_parts(store: Store, facts: Facts, session: SessionRecorded, most: int) -> Looked:
    """A session looked through, about `most` values at a time."""
    files = files_of(store, facts, session)
    parts = _parts(session, files, most)
    specs = {source.spec.name: source.spec for one in files for source in one.sources}
    means = _Means.of(list(specs.values()), parts, most)
    found: dict[str, _Channel] = {}
    for part in parts:
        _add(found, looked(load_within(session, files, part.read)), part, means)
    order = {name: i for i, name in enumerate(specs)}
    whole = sorted((one for one in found.values() if one.samples), key=lambda one: order.get(one.spec.name, len(order)))
    ends = [None if one.end_ns is None else _End(one.last_raw, one.end_ns) for one in whole]
    return Looked([one.channel() for one in whole], _to_the_end([one.quality() for one in whole], ends))


def _add(found: dict[str, _Channel], seen: Looked, part: _Part, means: _Means) -> None:
    for channel, own in zip(seen.channels, seen.qualities, strict=True):
        one = found.setdefault(channel.spec.name, _Channel(channel.spec, channel.raws, channel.buses))
        one.add(channel, own, part, means)


@dataclass(frozen=True)
class _Part:
    """A part of a session: from `first_ns` up to `end_ns`, which is left out; with what is `read` on either side."""

    first_ns: int
    end_ns: int
    read: tuple[int, int]


def _parts(session: SessionRecorded, files: Sequence[DecodedFile], most: int) -> list[_Part]:
    """Parts of about `most` values each, cut at whole seconds from the first sample on."""
    first, last, values = _spread(session, files)
    at = np.unique(np.concatenate([first, last]))
    change = np.zeros(len(at))
    np.add.at(change, np.searchsorted(at, first), values / (last - first))
    np.add.at(change, np.searchsorted(at, last), -values / (last - first))
    before = np.concatenate([[0.0], np.cumsum(np.cumsum(change)[:-1] * np.diff(at))])  # values up to each of `at`
    since = (at - at[0]).astype(np.float64)
    count = int(np.ceil(before[-1] / most))
    cuts = np.interp(np.arange(1, count) * before[-1] / count, before, since)
    seconds = np.unique((cuts // SECOND_NS).astype(np.int64))
    edges = np.concatenate([[at[0]], at[0] + seconds[seconds > 0] * SECOND_NS, [at[-1]]])
    held, beside = np.interp((edges - at[0]).astype(np.float64), since, before), BESIDE * most
    back, on = (at[0] + np.interp(held + far, before, since).astype(np.int64) for far in (-beside, beside))
    begin, end = np.maximum(edges - WINDOW_NS, back)[:-1], np.minimum(edges + WINDOW_NS, on)[1:]
    end[-1] = edges[-1]
    bounds = zip(edges[:-1].tolist(), edges[1:].tolist(), begin.tolist(), end.tolist(), strict=True)
    return [_Part(first, last, (a, b)) for first, last, a, b in bounds]


def _spread(session: SessionRecorded, files: Sequence[DecodedFile]) -> tuple[Ints, Ints, NDArray[np.float64]]:
    """Of each row group of a session (N,): its first stamp, the one after its last [ns], and how many values it has."""
    rows = [
        (*one.on_time(group, np.array(rows.t_ns), session.start_ns).tolist(), rows.rows * columns)
        for one, file in zip(files, session.files, strict=True)
        for group, columns, rows in one.row_groups()
        if rows.is_of(file)
    ]
    first, last, values = np.array(rows, np.int64).T
    return first, last + 1, values.astype(np.float64)


@dataclass(frozen=True)
class _Means:
    """The stretches of which means stay, from `start_ns` on: of a channel that drives, and of another [s]."""

    start_ns: int
    drive_s: int
    other_s: int

    @classmethod
    def of(cls, specs: Sequence[ResolvedChannel], parts: Sequence[_Part], most: int) -> _Means:
        """Means over so many seconds that about `most` of each kind are left."""
        start_ns, drive = parts[0].first_ns, sum(map(_drives, specs))
        span_s = (parts[-1].end_ns - start_ns) / SECOND_NS
        fine, coarse = (int(np.ceil(span_s * count / most)) for count in (drive, len(specs) - drive))
        return cls(start_ns, max(FINE_s, fine), max(COARSE_s, coarse))

    def __call__(self, channel: ChannelData) -> tuple[Ints, Array]:
        """The stamps at which a channel's stretches begin, (N,) [ns], and its means over them."""
        step_ns = (self.drive_s if _drives(channel.spec) else self.other_s) * SECOND_NS
        number = (channel.t_ns - self.start_ns) // step_ns
        begin = np.flatnonzero(np.diff(number, prepend=number[0] - 1))
        mean = np.add.reduceat(channel.value, begin) / np.diff(begin, append=len(number))
        return self.start_ns + number[begin] * step_ns, mean


def _drives(spec: ResolvedChannel) -> bool:
    return spec.quantity in DRIVE and spec.role != "ignored"


@dataclass
class _Channel:
    """What the parts so far say of one channel."""

    spec: ResolvedChannel
    raws: tuple[str, ...]
    buses: tuple[str, ...]
    samples: int = 0
    end_ns: int | None = None  # its last stamp
    last_raw: str = ""  # the file that it is from
    ranges: list[tuple[float, float]] = field(default_factory=list)  # a part: least and greatest value
    read: list[tuple[float, float]] = field(default_factory=list)  # and as they were read
    medians: list[float] = field(default_factory=list)  # a part: median interval [ns]
    noises: list[float] = field(default_factory=list)
    steps: list[float] = field(default_factory=list)
    gaps: list[Lapse] = field(default_factory=list)
    stretches: list[RepeatedSamples] = field(default_factory=list)
    means: list[tuple[Ints, Array]] = field(default_factory=list)

    def add(self, channel: ChannelData, seen: ChannelQuality, part: _Part, means: _Means) -> None:
        """Take in the samples of the part; those on either side of it only tell how these are to be judged."""
        first, last = np.searchsorted(channel.t_ns, (part.first_ns, part.end_ns)).tolist()
        self._stretch(channel, seen, part, self.samples - first)
        if first == last:
            return
        own = channel.samples(slice(first, last))
        stamps = own.t_ns if self.end_ns is None else np.concatenate([[self.end_ns], own.t_ns])
        if median := channel.median_ns:
            self.medians.append(median)
            self.gaps += quality.gaps_of(stamps, median)
        self.noises += [] if seen.noise is None else [seen.noise]
        self.steps += [] if seen.resolution is None else [seen.resolution]
        self.ranges.append((float(own.value.min()), float(own.value.max())))
        self.read.append((float(own.recorded.min()), float(own.recorded.max())))
        self.means.append(means(own))
        self.samples, self.end_ns = self.samples + len(own.t_ns), int(own.t_ns[-1])
        self.last_raw = channel.raws[own.raw[-1]]

    def _stretch(self, channel: ChannelData, seen: ChannelQuality, part: _Part, index: int) -> None:
        """Add the stretches that begin in the part, and lengthen the one that goes on from the part before."""
        before = [i for i, one in enumerate(self.stretches) if one.end_ns >= part.read[0]]
        for one in seen.stretches:
            cut = one.end_ns == channel.t_ns[-1] and part.end_ns != part.read[1] and one.duration_s * 1e9 < STUCK_NS
            kind = "held" if cut and one.kind == "stuck" else one.kind
            one = replace(one, kind=kind, first=one.first + index, last=one.last + index)
            goes_on = [
                i
                for i in before
                if self.stretches[i].value == one.value
                and self.stretches[i].end_ns >= one.start_ns
                and self.stretches[i].start_ns <= one.end_ns
            ]
            if goes_on:
                longer = self.stretches[goes_on[0]]
                end_ns, last = max(longer.end_ns, one.end_ns), max(longer.last, one.last)
                self.stretches[goes_on[0]] = replace(longer, end_ns=end_ns, last=last)
            elif part.first_ns <= one.start_ns < part.end_ns:
                self.stretches.append(one)

    def channel(self) -> ChannelData:
        """The channel of its means, each a sample at the beginning of its interval."""
        t_ns, value = (np.concatenate(column) for column in zip(*self.means, strict=True))
        zeros = np.zeros(len(t_ns), np.int64)
        return ChannelData(self.spec, t_ns, value, zeros, zeros, self.raws, self.buses)

    def quality(self) -> ChannelQuality:
        """What all of its samples look like; rate and noise are medians over the parts."""
        median = float(np.median(self.medians)) if self.medians else 0.0
        return ChannelQuality(
            name=self.spec.name,
            role=self.spec.role,
            samples=self.samples,
            rate_Hz=1e9 / median if median > 0 else None,
            low=min(low for low, _ in self.ranges),
            high=max(high for _, high in self.ranges),
            noise=float(np.median(self.noises)) if self.noises else None,
            resolution=min(self.steps, default=None),
            gaps=tuple(self.gaps),
            stretches=tuple(quality.sticking([self._judged(one) for one in self.stretches], self.spec.role)),
            good=np.ones(0, np.bool_),
        )

    def _judged(self, one: RepeatedSamples) -> RepeatedSamples:
        """A stretch by its whole length; saturated only at the least or greatest value of the whole channel."""
        if one.kind == "saturated" and one.value in (min(self.read)[0], max(high for _, high in self.read)):
            return one
        long = one.kind == "stuck" or one.duration_s * 1e9 >= STUCK_NS
        return replace(one, kind="stuck" if long else "held")
