"""The channels of a session as arrays, from the Parquet of its decodes, and the few ways to put them side by side."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ingest.bench.corrections import Correction, true_values
from ingest.bench.laws import AMBIENT, CURRENT, Surroundings
from ingest.bench.resolving import ResolvedChannel, valued
from ingest.catalogue.at_once import counted
from ingest.catalogue.decoded import DecodedFile, Table, decoded_file
from ingest.facts.events import SessionRecorded
from ingest.facts.facts import Facts
from ingest.texts.powers import hypot
from ingest.texts.quantities import STORED_UNIT

if TYPE_CHECKING:
    from ingest.facts.store import Store
    from ingest.log.samples import RowGroup

GIVEN_EVERY_NS = 60_000_000_000  # between samples of what the bench file gives as a number, at most MOST_GIVEN of them
MOST_GIVEN = 100_000
MOST_VALUES = 4_000_000  # of channels that are held at once: about 400 MB with what is computed of them
STALE_MEDIANS = 5.0  # a value is held for as many median intervals of its channel, not longer
GAP_NS = 10_000_000_000  # a second in a shorter gap counts as measured: constancy is looked at in means of 10 s

Array = NDArray[np.float64]
_Beside = Mapping[str, Callable[[NDArray[np.int64]], Array]]  # what is known beside readings -> stamps (N,) -> (N,)


@dataclass(frozen=True, eq=False)
class ChannelData:
    """The samples (N,) of a channel of a session that count, over its files, in the order of time; stamps and values
    corrected."""

    spec: ResolvedChannel
    t_ns: NDArray[np.int64]
    value: Array  # finite, in the stored unit of the quantity
    record: NDArray[np.int64]  # position among the records of its file
    raw: NDArray[np.int64]  # index into `raws`
    raws: tuple[str, ...]  # SHA-256 of the session's files that hold this channel
    buses: tuple[str, ...] = ()  # for each of these: what stamped its samples: logger, `can<n>` or stem of a table
    read: Array | None = None  # the values before they were corrected, None where they were not
    beside: ChannelData | None = None  # what other logs hold of it at the same time, which does not count

    @property
    def recorded(self) -> Array:
        """The values as they were read (N,): equal neighbours are equal there, whatever was taken off."""
        return self.value if self.read is None else self.read

    @property
    def unit(self) -> str | None:
        """Of `value`: the stored unit of the quantity, or the file's own where no bench file says what it is."""
        return STORED_UNIT.get(self.spec.quantity, self.spec.unit) or None

    @property
    def place(self) -> str | None:
        """Where it measures: a node or boundary, or "0.7 a + 0.3 b" for a weighted mean."""
        weights = " + ".join(f"{share:g} {node}" for node, share in self.spec.weights.items())
        return self.spec.node or weights or None

    def samples(self, which: slice | NDArray[np.int64] | NDArray[np.bool_]) -> ChannelData:
        """The channel with some of its samples, nothing beside it."""
        names = ("t_ns", "value", "record", "raw", *(() if self.read is None else ("read",)))
        return replace(self, beside=None, **{name: getattr(self, name)[which] for name in names})

    def with_beside(self, counts: NDArray[np.bool_]) -> ChannelData:
        """The channel with the samples that count, the others beside it."""
        return replace(self.samples(counts), beside=self.samples(~counts))

    @property
    def median_ns(self) -> float:
        """Median interval between samples [ns]; 0 with fewer than two."""
        return float(np.median(np.diff(self.t_ns))) if len(self.t_ns) > 1 else 0.0


@dataclass(frozen=True, eq=False)
class Aligned:
    """Channels on common stamps `t_ns` (N,), each valid for the `dt_s` [s] after it; `values`: one (N,) a channel."""

    t_ns: NDArray[np.int64]
    dt_s: Array
    values: tuple[Array, ...]


def load(store: Store, facts: Facts, session: SessionRecorded) -> list[ChannelData]:
    """Every channel of a session that has samples, in the order of its files; empty cells are left out.

    These are the channels of the bench file, the ignored ones too, less its corrections: those of the version accepted
    in place of the one that a file was decoded under. What goes with the ambient, the speed or the current stays in
    readings where the session does not know that. Without a bench file they are all signals: of the guessed quantity,
    in its stored unit, or else of quantity "" in the file's unit. Raises DamageError for Parquet or a bench file that
    is damaged or missing.
    """
    return next(load_each(store, facts, [session]))


def load_each(store: Store, facts: Facts, sessions: Sequence[SessionRecorded]) -> Iterator[list[ChannelData]]:
    """What `load` gives for each of these sessions, in turn; a file that several of them share is read once."""
    to_come = Counter(file["decode"] for session in sessions for file in session.files)
    kept: dict[str, tuple[DecodedFile, Mapping[str, Table]]] = {}
    for session in sessions:
        files = []
        for file in session.files:
            name = file["decode"]
            one, tables = kept.pop(name) if name in kept else _read(store, facts, file)
            files.append((one, tables, file))
            to_come[name] -= 1
            if to_come[name] and one.values <= MOST_VALUES:
                kept[name] = one, tables
        yield _channels(session, files)


def _read(store: Store, facts: Facts, file: Mapping[str, Any]) -> tuple[DecodedFile, Mapping[str, Table]]:
    """A file of a session with all its samples, or with those about the session's records where it holds too many."""
    one = decoded_file(store, facts, facts.decodes[file["decode"]])
    return one, one.tables(None if one.values <= MOST_VALUES else lambda _, rows: rows.is_of(file))


def load_within(session: SessionRecorded, files: Sequence[DecodedFile], span: tuple[int, int]) -> list[ChannelData]:
    """What `load` gives of the samples from `span[0]` up to `span[1]` [ns], which is left out.

    `files`: those of the session, in its order. Row groups without such samples are not read.
    """
    read = []
    for one, file in zip(files, session.files, strict=True):

        def wanted(group: str, rows: RowGroup, one: DecodedFile = one, file: Mapping[str, Any] = file) -> bool:
            first, last = one.on_time(group, np.array(rows.t_ns), session.start_ns).tolist()
            return rows.is_of(file) and bool(first < span[1] and last >= span[0])

        read.append((one, one.tables(wanted), file))
    return _channels(session, read, span)


def _channels(
    session: SessionRecorded,
    files: Sequence[tuple[DecodedFile, Mapping[str, Table], Mapping[str, Any]]],
    span: tuple[int, int] | None = None,
) -> list[ChannelData]:
    pieces: dict[str, list[_Piece]] = {}
    bench = None
    for one, tables, file in files:
        bench = one.bench or bench
        for piece in _of_file(one, tables, file, session.start_ns, span):
            pieces.setdefault(piece.spec.name, []).append(piece)
    beside = _beside(pieces, session.start_ns)
    joined = [_joined(some, session.start_ns, beside) for some in pieces.values()]
    return joined + [_throughout(spec, session, joined[0]) for spec in (valued(bench) if bench and joined else ())]


def step_of(value: Array) -> float | None:
    """The smallest step between neighbours in `value` (N,); what is below 1e-9 of it is rounding. None without any."""
    step = np.abs(np.diff(value))
    step = step[step > 1e-9 * np.abs(value).max(initial=0.0)]
    return float(step.min()) if len(step) else None


def find(channels: Sequence[ChannelData], quantity: str) -> ChannelData | None:
    """The first channel with samples of a quantity that the bench file does not ignore."""
    fitting = (one for one in channels if one.spec.quantity == quantity and len(one.t_ns))
    return next((one for one in fitting if one.spec.role != "ignored"), None)


def current(channels: Sequence[ChannelData]) -> ChannelData | None:
    """The phase current [A rms]: the channel `current`, else hypot of `current_d` and `current_q`, on d's stamps."""
    whole, d, q = (find(channels, name) for name in ("current", "current_d", "current_q"))
    if whole or not d or not q:
        return whole
    held = _held(q, d.t_ns)
    known = np.isfinite(held)
    return ChannelData(
        spec=replace(d.spec, name=f"hypot({d.spec.name}, {q.spec.name})", quantity="current"),
        t_ns=d.t_ns[known],
        value=hypot(d.value, held)[known],
        record=d.record[known],
        raw=d.raw[known],
        raws=d.raws,
    )


def aligned(channels: Sequence[ChannelData]) -> Aligned:
    """Samples held on the stamps of the slowest of these channels; stamps without a fresh value of each are left out.

    A value is fresh for 5 median intervals of its channel; a gap of the slowest counts as one median interval.
    """
    slowest = max(channels, key=lambda channel: channel.median_ns)
    median = slowest.median_ns
    values = [_held(channel, slowest.t_ns) for channel in channels]
    step = np.append(np.diff(slowest.t_ns), median)
    dt_s = np.where(step > STALE_MEDIANS * median, median, step) / 1e9
    known = np.isfinite(values).all(axis=0)
    return Aligned(slowest.t_ns[known], dt_s[known], tuple(value[known] for value in values))


def each_second(channels: Sequence[ChannelData], block_s: int = 1) -> tuple[list[Array], NDArray[np.bool_]]:
    """Means over each second of the time that the channels span together, (N,) each; an empty second holds the last.

    And which of these seconds (N,) were measured: those that lie in no channel's gap, nor before or after it. With
    `block_s` of each stretch of so many seconds.
    """
    span = (min(int(channel.t_ns[0]) for channel in channels), max(int(channel.t_ns[-1]) for channel in channels))
    means = [block_means(channel.t_ns, channel.value, span, block_s) for channel in channels]
    measured = [measured_blocks(channel, span[0], len(means[0]), block_s) for channel in channels]
    return means, np.all(measured, axis=0)


def block_means(t_ns: NDArray[np.int64], value: Array, span: tuple[int, int], block_s: float = 1.0) -> Array:
    """Means of `value` over blocks of `block_s` [s] from the first to the last stamp of `span` [ns], (N,).

    A block without samples holds the one before; those before the first sample hold the first.
    """
    start, end = span
    block = (t_ns - start) // int(block_s * 1e9)
    count = (end - start) // int(block_s * 1e9) + 1
    samples = np.bincount(block, minlength=count)
    mean = np.bincount(block, value, count) / np.maximum(samples, 1)
    last = np.maximum.accumulate(np.where(samples > 0, np.arange(count), 0))
    held: Array = mean[np.maximum(last, block[0])]
    return held


def measured_blocks(channel: ChannelData, start_ns: int, count: int, block_s: int) -> NDArray[np.bool_]:
    """Which of `count` blocks from `start_ns` are neither in a gap of the channel nor before or after it."""
    second = (channel.t_ns - start_ns) // (block_s * 1_000_000_000)
    gap = np.diff(channel.t_ns) > max(STALE_MEDIANS * channel.median_ns, GAP_NS)
    first, last = np.r_[second[0], second[1:][gap]], np.r_[second[:-1][gap], second[-1]]
    edges = np.bincount(first, minlength=count + 1) - np.bincount(last + 1, minlength=count + 1)
    return np.asarray(np.cumsum(edges)[:count] > 0)


@dataclass(frozen=True, eq=False)
class _Piece:
    """The samples of a channel in one file (N,), values as they were read; `bus`: what stamped them."""

    spec: ResolvedChannel
    steps: tuple[Correction, ...]
    raw: str
    bus: str
    t_ns: NDArray[np.int64]
    record: NDArray[np.int64]
    value: Array


def _of_file(
    one: DecodedFile, tables: Mapping[str, Table], file: Mapping[str, Any], start_ns: int, span: tuple[int, int] | None
) -> Iterator[_Piece]:
    """The samples of each channel in the records of one file that belong to the session, with their true stamps."""
    for source in one.sources:
        group = source.entry["group"]
        record, value = tables[group]["record"], tables[group][source.entry["column"]]
        inside = (record >= file["first_record"]) & (record <= file["last_record"])
        kept = (np.isin(record, file["rows"]) if "rows" in file else inside) & np.isfinite(value)
        t_ns = one.on_time(group, tables[group]["t_ns"][kept], start_ns)
        if span is not None:
            inside = (t_ns >= span[0]) & (t_ns < span[1])
            kept[kept], t_ns = inside, t_ns[inside]
        if len(t_ns):
            stored = value[kept] if one.decode.bench else source.spec.conversion(value[kept])
            spec, bus = one.as_logged(source), one.clocks[group]
            yield _Piece(spec, source.steps, one.decode.raw, bus, t_ns, record[kept], stored)


def _beside(pieces: Mapping[str, Sequence[_Piece]], start_ns: int) -> _Beside:
    """What corrections need beside readings, of what is recorded: the ambient temperature, the mean over its channels;
    the magnitudes of speed and phase current."""
    needed = {step.rule.needs for some in pieces.values() for piece in some for step in piece.steps} - {""}
    found: dict[str, Callable[[NDArray[np.int64]], Array]] = {}
    for name in needed:
        own = [_joined(some, start_ns, {}) for some in pieces.values() if _may_be(some[0].spec, name)]
        if name != AMBIENT:
            whole = current(own) if name == CURRENT else find(own, name)
            own = [replace(whole, value=np.abs(whole.value))] if whole else []
        if own:
            found[name] = partial(_between, own)
    return found


def _may_be(spec: ResolvedChannel, name: str) -> bool:
    """Whether a channel is, or is a part of, what is known beside readings under this name."""
    if spec.role == "ignored":
        return False
    if name == AMBIENT:
        return (spec.node, spec.quantity) == (AMBIENT, "temperature")
    return spec.quantity in (name, f"{name}_d", f"{name}_q")


def _between(some: Sequence[ChannelData], t_ns: NDArray[np.int64]) -> Array:
    """The mean of channels at stamps (N,), between their samples."""
    return np.asarray(np.mean([np.interp(t_ns, one.t_ns, one.value) for one in some], axis=0))


def _joined(some: Sequence[_Piece], start_ns: int, beside: _Beside) -> ChannelData:
    """One channel from its pieces in several files, by time; its resolution from the data where none was known."""
    pieces = {piece.raw: piece for piece in some}
    raws = tuple(pieces)
    t_ns, record, read = (
        np.concatenate([getattr(piece, name) for piece in some]) for name in ("t_ns", "record", "value")
    )
    value = np.concatenate([_true_values(piece, start_ns, beside) for piece in some]).astype(np.float64)
    raw = np.concatenate([np.full(len(piece.t_ns), raws.index(piece.raw), np.int64) for piece in some])
    order = np.argsort(t_ns, kind="stable")
    counts = counted(t_ns[order], read[order], raw[order])
    step = step_of(read[order][counts])
    whole = ChannelData(
        spec=some[0].spec.with_step(step) if step else some[0].spec,
        t_ns=t_ns[order],
        value=value[order],
        record=record[order],
        raw=raw[order],
        raws=raws,
        buses=tuple(piece.bus for piece in pieces.values()),
        read=read[order].astype(np.float64) if any(piece.steps for piece in some) else None,
    )
    return whole if counts.all() else whole.with_beside(counts)


def _throughout(spec: ResolvedChannel, session: SessionRecorded, beside: ChannelData) -> ChannelData:
    """What the bench file gives as a number, by the clock of `beside`: once a minute or so from the start of a session
    to its end, as what is silent for longer than minutes is no input."""
    span_ns = max(session.end_ns - session.start_ns, 1)
    count = min(span_ns // GIVEN_EVERY_NS + 2, MOST_GIVEN)
    t_ns = session.start_ns + np.linspace(0, span_ns, count).astype(np.int64)
    zeros, value = np.zeros(count, np.int64), np.full(count, spec.value, np.float64)
    return ChannelData(spec, t_ns, value, zeros, zeros, beside.raws[:1], beside.buses[:1])


def _true_values(piece: _Piece, start_ns: int, beside: _Beside) -> Array:
    if not piece.steps:
        return piece.value
    known = {name: at(piece.t_ns) for name, at in beside.items()}
    return true_values(piece.value, piece.steps, Surroundings((piece.t_ns - start_ns) / 3.6e12, known))


def _held(channel: ChannelData, t_ns: NDArray[np.int64]) -> Array:
    """The last value at or before each stamp; NaN before the first and where that value is stale."""
    at = np.searchsorted(channel.t_ns, t_ns, side="right") - 1
    age = t_ns - channel.t_ns[np.maximum(at, 0)]
    fresh = (at >= 0) & (age <= STALE_MEDIANS * max(channel.median_ns, 1.0))
    return np.where(fresh, channel.value[np.maximum(at, 0)], np.nan)
