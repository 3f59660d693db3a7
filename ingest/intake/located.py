"""Records of a sealed log, found again in its sealed bytes: where each stands, and what is in it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ingest.errors import DamageError, UnreadableLogError
from ingest.facts.durable import scratch
from ingest.facts.events import DecodeCompleted
from ingest.facts.facts import Facts
from ingest.facts.store import Store
from ingest.formats import REMOTE, Frames, Rows, open_log, recognise
from ingest.intake.setup import sealed_setup
from ingest.log.recording import id_text
from ingest.texts.names import first_of
from ingest.texts.times import to_second

CELLS = 8  # of a row that are shown


@dataclass(frozen=True)
class Located:
    """One record of a log. `where`: its place in the file, None where the format does not tell; `t_ns`: its stamp, None
    of a rejected record; `holds`: a frame in hexadecimal, or the cells of a row."""

    record: int  # from 0
    where: str | None
    t_ns: int | None
    holds: str

    def stamp(self, absolute: bool) -> str:
        """As people read it."""
        if self.t_ns is None:
            return "rejected"
        seconds = f"{self.t_ns % 1_000_000_000:09}".rstrip("0")
        if not absolute:
            return f"{self.t_ns / 1e9:.9g} s"
        stamp = to_second(self.t_ns)
        return f"{stamp}.{seconds}" if seconds else stamp


def locate(store: Store, facts: Facts, decode: DecodeCompleted, records: Sequence[int]) -> list[Located]:
    """These records of the log that was decoded so, read from its sealed bytes up to the last of them.

    Raises DamageError where the bytes are not what was sealed; a record that is not there has no entry.
    """
    sealed = facts.files[decode.raw]
    with scratch() as folder:
        named = folder / sealed.name  # readers know a format by its name
        try:
            store.archive.lend(decode.raw, named)
        except DamageError as error:
            raise DamageError(f"{sealed.name}: {error}") from None
        time = sealed_setup(store, facts, decode).time(recognise(named), sealed.name)
        log = open_log(named, time)
        log.sought = sorted(set(records))
        found: dict[int, Located] = {}
        try:
            for batch in log.batches():
                found |= {
                    one: Located(one, log.places.get(one), *_read(batch, i)) for i, one in _sought(batch, log.sought)
                }
                beyond = isinstance(batch, Frames) and len(batch.record) and batch.record[-1] >= log.sought[-1]
                if beyond or len(found) == len(log.sought):  # series of a table come one after another
                    break
        except UnreadableLogError:  # cut behind what could be read: what was found before stands
            pass
        for one in log.rejected:
            if one.record in log.sought:
                found[one.record] = Located(one.record, one.where, None, f"{one.why}: {one.raw.hex(' ')}")
    return [found[one] for one in sorted(found)]


def _sought(batch: Frames | Rows, records: Sequence[int]) -> Iterator[tuple[int, int]]:
    """(place in the batch, record) of those that are sought."""
    for i in np.flatnonzero(np.isin(batch.record, records)).tolist():
        yield i, int(batch.record[i])


def _read(batch: Frames | Rows, i: int) -> tuple[int, str]:
    """The stamp [ns] of record `i` of a batch, and what it holds."""
    t_ns = int(batch.t_ns[i])
    if isinstance(batch, Frames):
        data = batch.data[batch.offsets[i] : batch.offsets[i + 1]].tobytes()
        payload = "remote frame" if batch.flags[i] & REMOTE else data.hex(" ") or "no payload"
        return t_ns, f"{id_text(int(batch.bus[i]), int(batch.can_id[i]))}: {payload}"
    cells = [f"{name} {values[i]}" for name, values in batch.columns.items()]
    return t_ns, first_of(cells, CELLS)
