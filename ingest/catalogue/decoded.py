"""A decode as the catalogue reads it: what its bench file says of its channels, and their samples from its Parquet."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ingest.bench.bench_file import Bench, read_bench
from ingest.bench.corrections import Correction, correct, logger_lag_s, spelt, true_times
from ingest.bench.resolving import ResolvedChannel, resolve
from ingest.bench.signals import Directory, Signal
from ingest.errors import DamageError, UnitError
from ingest.facts.bucket import Place
from ingest.facts.events import DecodeCompleted, SessionRecorded
from ingest.facts.facts import Facts
from ingest.texts.guessing import guess, unit_in_name
from ingest.texts.quantities import STORED_UNIT, Conversion, converter

if TYPE_CHECKING:
    from ingest.facts.store import Store
    from ingest.log.samples import RowGroup

Entry = Mapping[str, Any]  # of DecodeCompleted.channels
Table = Mapping[str, NDArray[Any]]  # column -> samples (N,), `t_ns` and `record` among them
Wanted = Callable[[str, "RowGroup"], bool]  # whether a row group of this group is to be read


@dataclass(frozen=True)
class ChannelSource:
    """A channel as one decode holds it: its entry there, its description, and what is to be taken off its values."""

    entry: Entry
    spec: ResolvedChannel
    steps: tuple[Correction, ...] = ()


@dataclass(frozen=True, eq=False)
class DecodedFile:
    """One log under one bench file: its channels; their samples are read when they are asked for."""

    decode: DecodeCompleted
    folder: Place
    log: str  # its name
    bench: Bench | None
    sources: Sequence[ChannelSource]

    def tables(self, wanted: Wanted | None = None) -> dict[str, Table]:
        """Group -> the samples of its channels, all or of the row groups that are `wanted`. Raises DamageError."""
        return {name: self._table(name, wanted) for name in self._groups}

    @property
    def values(self) -> int:
        """How many values `tables` gives, stamps and records not counted."""
        rows = {group["name"]: int(group["rows"]) for group in self.decode.groups}
        return sum(rows[group] * len(columns) for group, (_, columns) in self._groups.items())

    def row_groups(self) -> Iterator[tuple[str, int, RowGroup]]:
        """(group, how many of its columns channels are read from, row group), of each. Raises DamageError."""
        from ingest.log import samples

        for name, (path, columns) in self._groups.items():
            if columns:
                with _there(path):
                    yield from ((name, len(columns), one) for one in samples.row_groups(path))

    def on_time(self, group: str, t_ns: NDArray[np.int64], start_ns: int) -> NDArray[np.int64]:
        """Stamps (N,) [ns] of a group without what the bench file says that its clock is late by."""
        return true_times(t_ns, self.bench.corrections if self.bench else (), self.clocks[group], start_ns)

    @property
    def corrections(self) -> tuple[Correction, ...]:
        """What the bench file says is wrong when the log begins, of clocks with those that stamp it."""
        clocks = {spelt(name) for name in self.clocks.values()}
        known = self.bench.corrections if self.bench else ()
        return tuple(one for one in known if one.kind != "clock" or one.place in clocks)

    def as_logged(self, source: ChannelSource) -> ResolvedChannel:
        """The description of a channel with what the bench file says that its logger smooths."""
        lag_s = logger_lag_s(self.bench.corrections if self.bench else (), self.clocks[source.entry["group"]])
        return replace(source.spec, time_constant_s=source.spec.time_constant_s + lag_s) if lag_s else source.spec

    @cached_property
    def clocks(self) -> dict[str, str]:
        """Group -> what stamps it: the logger that the bench file knows, else its bus, or the table itself where it
        names none."""
        if self.bench and (logger := self.bench.logger_of(self.log)):
            return {group["name"]: logger.name for group in self.decode.groups}
        buses = {entry["group"]: entry["signal"]["bus"] for entry in self.decode.channels if entry["signal"]}
        stem = self.log.split(".")[0]
        return {group["name"]: buses.get(group["name"]) or stem for group in self.decode.groups}

    @cached_property
    def _groups(self) -> dict[str, tuple[Place, list[str]]]:
        """Group -> its Parquet file, and the columns of it that channels are read from."""
        columns: dict[str, dict[str, None]] = {group["name"]: {} for group in self.decode.groups}
        for source in self.sources:
            columns[source.entry["group"]][source.entry["column"]] = None
        return {
            group["name"]: (self.folder / group["file"], list(columns[group["name"]])) for group in self.decode.groups
        }

    def _table(self, group: str, wanted: Wanted | None) -> Table:
        from ingest.log import samples

        path, columns = self._groups[group]
        if not columns:
            return {}
        with _there(path):
            some = None
            if wanted is not None:
                some = [i for i, one in enumerate(samples.row_groups(path)) if wanted(group, one)]
            table = samples.read(path, list(dict.fromkeys(["t_ns", "record", *columns])), some)
        return {name: table.column(name).to_numpy() for name in table.column_names}


def decoded_file(store: Store, facts: Facts, decode: DecodeCompleted) -> DecodedFile:
    """A decode, its channels by the version of its bench file that is current. Raises DamageError."""
    refuse_forgotten(store, decode.decode)
    sha = facts.current(decode.bench) if decode.bench else None
    bench = _read_at(store, facts, sha, decode) if sha else None
    sources = _of_bench(bench, decode) if bench else [ChannelSource(entry, _guess(entry)) for entry in decode.channels]
    return DecodedFile(decode, store.decoded(decode.decode), facts.files[decode.raw].name, bench, sources)


def files_of(store: Store, facts: Facts, session: SessionRecorded, bench: str | None = None) -> list[DecodedFile]:
    """The decodes of a session. `bench`: SHA-256 of the version of their bench file that counts, None for the current
    one. Raises DamageError."""
    files = [decoded_file(store, facts, facts.decodes[file["decode"]]) for file in session.files]
    return [replace(one, bench=_read_at(store, facts, bench, one.decode)) for one in files] if bench else files


def taken_off(files: Sequence[DecodedFile]) -> list[str]:
    """What a bench file says is wrong with logs, and all that computes takes off, each in words."""
    return list(dict.fromkeys(correction.says for one in files for correction in one.corrections))


def _read_at(store: Store, facts: Facts, sha: str, decode: DecodeCompleted) -> Bench:
    """A version of a bench file as it is when the log of a decode begins."""
    begin = decode.start_ns if decode.absolute else None
    return read_bench(store.archive.read(sha), facts.benches[sha].name).at(begin)


def refuse_forgotten(store: Store, decode: str) -> None:
    """Raises DamageError where the samples of a decode (id) had to go, as they may as of an earlier time."""
    if not store.decoded(decode).exists() and (why := store.forgotten.decodes.get(decode)):
        raise DamageError(f"{why}: its samples are gone")


def _of_bench(bench: Bench, decode: DecodeCompleted) -> list[ChannelSource]:
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
        ChannelSource(entry, replace(one[0], name=entry["name"], region=entry.get("region", one[0].region)), one[1])
        for entry, one in matched
        if one
    ]


def _guess(entry: Entry) -> ResolvedChannel:
    """A signal that no bench file speaks of: of the guessed quantity where its unit fits that, else of none. The unit
    is the file's, or what the name ends in; where nothing says it ("") values are taken as in the stored one."""
    name = entry["name"]
    unit = entry["unit"] or unit_in_name(name) or ""
    quantity = entry["quantity"] or guess(name, unit) or ""
    try:
        conversion = converter(unit or STORED_UNIT.get(quantity, ""), quantity)
    except UnitError:
        quantity, conversion = "", Conversion()
    return ResolvedChannel(name, quantity, unit, conversion=conversion, signals=(), role=entry["role"])


@contextmanager
def _there(path: Place) -> Iterator[None]:
    try:
        yield
    except FileNotFoundError:
        says = f"{path}: the samples are not there. Make them again from the archive with `whyhot rebuild`."
        raise DamageError(says) from None
