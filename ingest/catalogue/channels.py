"""The channels of a session as arrays, from the Parquet of its decodes, and the few ways to put them side by side."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ingest.bench.bench_file import Bench, read_bench
from ingest.bench.corrections import AMBIENT, Correction, correct, true_times, true_values
from ingest.bench.resolving import ResolvedChannel, resolve, valued
from ingest.bench.signals import Directory, Signal
from ingest.errors import DamageError, UnitError
from ingest.facts.events import DecodeCompleted, SessionRecorded
from ingest.facts.facts import Facts
from ingest.texts.powers import hypot
from ingest.texts.quantities import STORED_UNIT, Conversion, converter

if TYPE_CHECKING:
    from ingest.facts.store import Store

STALE_MEDIANS = 5.0  # a value is held for as many median intervals of its channel, not longer
GAP_NS = 10_000_000_000  # a second in a shorter gap counts as measured: constancy is looked at in means of 10 s

Array = NDArray[np.float64]
_Entry = Mapping[str, Any]  # of DecodeCompleted.channels
_Around = Callable[[NDArray[np.int64]], Array]  # stamps (N,) -> temperatures (N,) [degC]


@dataclass(frozen=True, eq=False)
class ChannelData:
    """All samples (N,) of a channel of a session, over its files, in the order of time; stamps and values corrected."""

    spec: ResolvedChannel
    t_ns: NDArray[np.int64]
    value: Array  # finite, in the stored unit of the quantity
    record: NDArray[np.int64]  # position among the records of its file
    raw: NDArray[np.int64]  # index into `raws`
    raws: tuple[str, ...]  # SHA-256 of the session's files that hold this channel
    buses: tuple[str, ...] = ()  # for each of these: what stamped its samples, `can<n>` or the stem of a table's name
    read: Array | None = None  # the values before they were corrected, None where they were not

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
    in place of the one that a file was decoded under. Heat along a sensor's leads stays in where the session does not
    know the ambient. Without a bench file they are all signals: of the guessed quantity, in its stored unit, or else of
    quantity "" in the file's unit. Raises DamageError for Parquet or a bench file that is damaged or missing.
    """
    return next(load_each(store, facts, [session]))


def load_each(store: Store, facts: Facts, sessions: Sequence[SessionRecorded]) -> Iterator[list[ChannelData]]:
    """What `load` gives for each of these sessions, in turn; a file that several of them share is read once."""
    to_come = Counter(file["decode"] for session in sessions for file in session.files)
    decoded: dict[str, _Decoded] = {}
    for session in sessions:
        pieces: dict[str, list[_Piece]] = {}
        bench = None
        for file in session.files:
            name = file["decode"]
            one = decoded.pop(name) if name in decoded else _decoded(store, facts, facts.decodes[name])
            bench = one.bench or bench
            for piece in _of_file(one, file):
                moved = _on_time(piece, one.bench, one.stem, session.start_ns)
                pieces.setdefault(piece.spec.name, []).append(moved)
            to_come[name] -= 1
            if to_come[name]:
                decoded[name] = one
        around = _ambient(pieces, session.start_ns)
        joined = [_joined(some, session.start_ns, around) for some in pieces.values()]
        yield joined + [_throughout(spec, session, joined[0]) for spec in (valued(bench) if bench and joined else ())]


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


def each_second(channels: Sequence[ChannelData]) -> tuple[list[Array], NDArray[np.bool_]]:
    """Means over each second of the time that the channels span together, (N,) each; an empty second holds the last.

    And which of these seconds (N,) were measured: those that lie in no channel's gap, nor before or after it.
    """
    span = (min(int(channel.t_ns[0]) for channel in channels), max(int(channel.t_ns[-1]) for channel in channels))
    means = [block_means(channel.t_ns, channel.value, span) for channel in channels]
    return means, np.all([_measured(channel, span[0], len(means[0])) for channel in channels], axis=0)


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


def _measured(channel: ChannelData, start_ns: int, count: int) -> NDArray[np.bool_]:
    """Which of `count` seconds from `start_ns` are neither in a gap of the channel nor before or after it."""
    second = (channel.t_ns - start_ns) // 1_000_000_000
    gap = np.diff(channel.t_ns) > max(STALE_MEDIANS * channel.median_ns, GAP_NS)
    first, last = np.r_[second[0], second[1:][gap]], np.r_[second[:-1][gap], second[-1]]
    edges = np.bincount(first, minlength=count + 1) - np.bincount(last + 1, minlength=count + 1)
    return np.asarray(np.cumsum(edges)[:count] > 0)


@dataclass(frozen=True)
class _Source:
    """A channel as one decode holds it: its entry there, its description, and what is to be taken off its values."""

    entry: _Entry
    spec: ResolvedChannel
    steps: tuple[Correction, ...] = ()


@dataclass(frozen=True, eq=False)
class _Decoded:
    """All that a decode holds of its channels: group -> column -> samples. `stem` of the log's name."""

    decode: DecodeCompleted
    stem: str
    bench: Bench | None
    sources: Sequence[_Source]
    tables: Mapping[str, Mapping[str, NDArray[Any]]]


@dataclass(frozen=True, eq=False)
class _Piece:
    """The samples of a channel in one file (N,), values as they were read. `bus` as in the file, None of a table."""

    spec: ResolvedChannel
    steps: tuple[Correction, ...]
    raw: str
    bus: str | None
    t_ns: NDArray[np.int64]
    record: NDArray[np.int64]
    value: Array


def _of_bench(bench: Bench, decode: DecodeCompleted) -> list[_Source]:
    """What a decode recorded of each channel of its bench file, and the channel, resolved again from the sealed file.

    The samples are converted already; which nodes are boundaries was known then, when the motor file was at hand.
    """
    signals = [Signal(**entry["signal"]) for entry in decode.channels if entry["signal"]]
    directory = Directory(signals)
    corrected = correct(bench.name, bench.channels, bench.corrections)
    here = [
        (channel, steps)
        for channel, steps in zip(corrected.channels, corrected.steps, strict=True)
        if channel.quantity and channel.needs and all(directory.find(name) for name in channel.needs)
    ]
    around = {entry["node"] for entry in decode.channels if entry["role"] == "input" and entry["node"]}
    specs = resolve(replace(bench, channels=tuple(channel for channel, _ in here)), signals, around)
    found = [(spec, steps) for spec, (_, steps) in zip(specs, here, strict=True)]
    derived = {one[0].name: one for one in found if one[0].derived}
    plain = {one[0].signals[0]: one for one in found if not one[0].derived}
    matched = [
        (entry, plain.get(Signal(**entry["signal"])) if entry["signal"] else derived.get(entry["name"]))
        for entry in decode.channels
    ]
    return [
        _Source(entry, replace(one[0], name=entry["name"], region=entry.get("region", one[0].region)), one[1])
        for entry, one in matched
        if one
    ]


def _guess(entry: _Entry) -> ResolvedChannel:
    """A signal that no bench file speaks of: of the guessed quantity where the file's unit fits that, else of none."""
    quantity, unit = entry["quantity"] or "", entry["unit"] or ""
    try:
        conversion = converter(unit, quantity)
    except UnitError:
        quantity, conversion = "", Conversion()
    return ResolvedChannel(entry["name"], quantity, unit, conversion=conversion, signals=(), role=entry["role"])


def _decoded(store: Store, facts: Facts, decode: DecodeCompleted) -> _Decoded:
    sha = facts.current(decode.bench) if decode.bench else None
    bench = read_bench(store.archive.read(sha), facts.benches[sha].name) if sha else None
    sources = _of_bench(bench, decode) if bench else [_Source(entry, _guess(entry)) for entry in decode.channels]
    folder = store.decoded(decode.decode)
    tables = {
        group["name"]: _read(
            folder / group["file"], [one.entry["column"] for one in sources if one.entry["group"] == group["name"]]
        )
        for group in decode.groups
    }
    return _Decoded(decode, facts.files[decode.raw].name.split(".")[0], bench, sources, tables)


def _of_file(one: _Decoded, file: Mapping[str, Any]) -> Iterator[_Piece]:
    """The samples of each channel in the records of one file that belong to the session."""
    decode, tables = one.decode, one.tables
    buses = {entry["group"]: entry["signal"]["bus"] for entry in decode.channels if entry["signal"]}
    for source in one.sources:
        group = source.entry["group"]
        record, value = tables[group]["record"], tables[group][source.entry["column"]]
        kept = (record >= file["first_record"]) & (record <= file["last_record"]) & np.isfinite(value)
        if kept.any():
            stored = value[kept] if decode.bench else source.spec.conversion(value[kept])
            t_ns = tables[group]["t_ns"][kept]
            yield _Piece(source.spec, source.steps, decode.raw, buses.get(group), t_ns, record[kept], stored)


def _on_time(piece: _Piece, bench: Bench | None, stem: str, start_ns: int) -> _Piece:
    """A piece with its true stamps, and the bus whose clock these go by: the table itself where it names none."""
    bus = piece.bus or stem
    return replace(piece, bus=bus, t_ns=true_times(piece.t_ns, bench.corrections if bench else (), bus, start_ns))


def _ambient(pieces: Mapping[str, Sequence[_Piece]], start_ns: int) -> _Around | None:
    """The ambient temperature, the mean over its channels; None where it is not needed, or not recorded."""
    if not any(step.rule.needs_ambient for some in pieces.values() for piece in some for step in piece.steps):
        return None
    found = [
        _joined(some, start_ns, None)
        for some in pieces.values()
        if (some[0].spec.node, some[0].spec.quantity) == (AMBIENT, "temperature") and some[0].spec.role != "ignored"
    ]
    if not found:
        return None
    return lambda t_ns: np.asarray(np.mean([np.interp(t_ns, one.t_ns, one.value) for one in found], axis=0))


def _read(path: Path, columns: Sequence[str]) -> dict[str, NDArray[Any]]:
    from ingest.log import samples

    if not columns:
        return {}
    try:
        table = samples.read(path, list(dict.fromkeys(["t_ns", "record", *columns])))
    except FileNotFoundError:
        says = f"{path}: the samples are not there. Make them again from the archive with `whyhot rebuild`."
        raise DamageError(says) from None
    return {name: table.column(name).to_numpy() for name in table.column_names}


def _joined(some: Sequence[_Piece], start_ns: int, around: _Around | None) -> ChannelData:
    """One channel from its pieces in several files, by time; its resolution from the data where none was known."""
    pieces = {piece.raw: piece for piece in some}
    raws = tuple(pieces)
    t_ns, record, read = (
        np.concatenate([getattr(piece, name) for piece in some]) for name in ("t_ns", "record", "value")
    )
    value = np.concatenate([_true_values(piece, start_ns, around) for piece in some]).astype(np.float64)
    raw = np.concatenate([np.full(len(piece.t_ns), raws.index(piece.raw), np.int64) for piece in some])
    order = np.argsort(t_ns, kind="stable")
    order = order[_once(t_ns[order], read[order], raw[order])]
    read, step = read[order].astype(np.float64), step_of(read[order])
    return ChannelData(
        spec=some[0].spec.with_step(step) if step else some[0].spec,
        t_ns=t_ns[order],
        value=value[order],
        record=record[order],
        raw=raw[order],
        raws=raws,
        buses=tuple(str(piece.bus) for piece in pieces.values()),
        read=read if any(piece.steps for piece in some) else None,
    )


def _throughout(spec: ResolvedChannel, session: SessionRecorded, beside: ChannelData) -> ChannelData:
    """What the bench file gives as a number, from the start of a session to its end, by the clock of `beside`."""
    t_ns = np.array([session.start_ns, max(session.end_ns, session.start_ns + 1)])
    zeros, value = np.zeros(2, np.int64), np.full(2, spec.value, np.float64)
    return ChannelData(spec, t_ns, value, zeros, zeros, beside.raws[:1], beside.buses[:1])


def _true_values(piece: _Piece, start_ns: int, around: _Around | None) -> Array:
    if not piece.steps:
        return piece.value
    ambient = around(piece.t_ns) if around else None
    return true_values(piece.value, piece.steps, (piece.t_ns - start_ns) / 3.6e12, ambient)


def _once(t_ns: NDArray[np.int64], value: NDArray[Any], raw: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Which samples to keep (N,): not those of a copied log, which repeat the one before from another file."""
    first = np.ones(len(t_ns), dtype=np.bool_)
    first[1:] = (np.diff(t_ns) != 0) | (value[1:] != value[:-1]) | (raw[1:] == raw[:-1])
    return first


def _held(channel: ChannelData, t_ns: NDArray[np.int64]) -> Array:
    """The last value at or before each stamp; NaN before the first and where that value is stale."""
    at = np.searchsorted(channel.t_ns, t_ns, side="right") - 1
    age = t_ns - channel.t_ns[np.maximum(at, 0)]
    fresh = (at >= 0) & (age <= STALE_MEDIANS * max(channel.median_ns, 1.0))
    return np.where(fresh, channel.value[np.maximum(at, 0)], np.nan)
