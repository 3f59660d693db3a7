"""The samples of a session as rows: one a stamp, a column a channel, in parts that memory holds."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ingest.bench.resolving import ResolvedChannel
from ingest.catalogue.channels import MOST_VALUES, ChannelData, load, load_within
from ingest.catalogue.decoded import DecodedFile, files_of
from ingest.facts.events import SessionRecorded
from ingest.facts.facts import Facts
from ingest.texts.names import each_once
from ingest.texts.quantities import STORED_UNIT
from ingest.texts.units import with_unit
from replay.errors import ExportError

if TYPE_CHECKING:
    from ingest.facts.store import Store

PART_VALUES = 200_000  # about so many a part

Span = tuple[int, int]  # [ns], the end left out
EVER: Span = (-(2**62), 2**62)
Stamps = NDArray[np.int64]
Values = NDArray[np.float64]
Part = tuple[Stamps, Values]  # (N,) [ns], (N, C): NaN where a channel has no sample at a stamp


@dataclass(frozen=True)
class OutColumn:
    """A channel as other programs see it; `unit` is the stored one of its quantity, None where nobody says one."""

    name: str
    unit: str | None
    quantity: str
    place: str | None

    @property
    def title(self) -> str:
        """`TC_winding [degC]`; the name alone where nobody says a unit."""
        return with_unit(self.name, self.unit) if self.unit else self.name


@dataclass(frozen=True, eq=False)
class SessionRows:
    """A session's name, its columns, and its rows in the order of time. `start_ns`: of its first sample, since 1970 in
    UTC if `absolute`, else since its logger began."""

    name: str
    absolute: bool
    start_ns: int
    columns: Sequence[OutColumn]
    unnamed: Sequence[str]  # signals of its logs that its bench file does not name: they are left out
    texts: Sequence[str]  # and columns of text
    parts: Iterator[Part]

    @property
    def titles(self) -> tuple[str, ...]:
        """Of its columns, each once."""
        return each_once([one.title for one in self.columns])

    def seconds(self, t_ns: Stamps) -> Values:
        """Since the session's start [s]."""
        since: Values = (t_ns - self.start_ns) / 1e9
        return since


def session_rows(store: Store, facts: Facts, session: SessionRecorded, most: int = MOST_VALUES) -> SessionRows:
    """All samples of a session, corrected as replays read them; `most` values are held at once.

    Raises ExportError where there are none, DamageError where they are damaged or missing.
    """
    files = files_of(store, facts, session)
    specs = {source.spec.name: source.spec for one in files for source in one.sources}
    values = sum(one.values for one in files)
    numbers = [{entry["column"] for entry in one.decode.channels} for one in files]
    texts = {
        name: None
        for one, own in zip(files, numbers, strict=True)
        for group in one.decode.groups
        for name in group["columns"]
        if name not in own
    }
    unnamed = {entry["name"]: None for one in files for entry in one.decode.channels if entry["name"] not in specs}
    if not values:
        why = "its bench file names none of its signals" if unnamed else "it holds no samples"
        raise ExportError(f"session {session.name}: {why}: there is nothing to export.")
    columns = [_column(spec) for spec in specs.values()]
    parts = _parts(store, facts, session, files, list(specs), values, most)
    return SessionRows(session.name, session.absolute, session.start_ns, columns, [*unnamed], [*texts], parts)


def _parts(
    store: Store,
    facts: Facts,
    session: SessionRecorded,
    files: Sequence[DecodedFile],
    names: Sequence[str],
    values: int,
    most: int,
) -> Iterator[Part]:
    """The rows of these channels: of a session that memory holds read at once, of a longer one by stretches."""
    for stretch in [EVER] if values <= most else _spans(session, values, most // 4):
        channels = load(store, facts, session) if stretch == EVER else load_within(session, files, stretch)
        for span in _spans(session, values, PART_VALUES, stretch):
            part = _rows([_inside(channels, name, span) for name in names])
            if len(part[0]):
                yield part


def _column(spec: ResolvedChannel) -> OutColumn:
    weights = " + ".join(f"{share:g} {node}" for node, share in spec.weights.items())
    said = spec.unit or spec.signals  # else the log has no unit, and no bench file says one
    unit = STORED_UNIT.get(spec.quantity, spec.unit) if said else None
    return OutColumn(spec.name, unit or None, spec.quantity, spec.node or weights or None)


def _spans(session: SessionRecorded, values: int, a_part: int, within: Span = EVER) -> Iterator[Span]:
    """Stretches of time of about so many values each, as far as they lie within one; the outer two never end."""
    edges = np.linspace(session.start_ns, session.end_ns, -(-values // a_part) + 1).astype(np.int64)[1:-1].tolist()
    for first, end in zip([EVER[0], *edges], [*edges, EVER[1]], strict=True):
        if max(first, within[0]) < min(end, within[1]):
            yield max(first, within[0]), min(end, within[1])


def _inside(channels: Sequence[ChannelData], name: str, span: Span) -> tuple[Stamps, Values]:
    """The samples of the channel of this name, none where it is not there."""
    for one in channels:
        if one.spec.name == name:
            a, b = np.searchsorted(one.t_ns, span)
            return one.t_ns[a:b], one.value[a:b]
    return np.empty(0, np.int64), np.empty(0)


def _rows(columns: Sequence[tuple[Stamps, Values]]) -> Part:
    """Columns side by side, a row a stamp; the second of two values at one stamp stands in a row of its own."""
    t_ns, nth = (np.concatenate(own) for own in ([t for t, _ in columns], [_nth(t) for t, _ in columns]))
    order = np.lexsort((nth, t_ns))
    t_ns, nth = t_ns[order], nth[order]
    new = np.ones(len(order), np.bool_)
    new[1:] = (np.diff(t_ns) != 0) | (np.diff(nth) != 0)
    row = np.empty(len(order), np.int64)
    row[order] = np.cumsum(new) - 1
    place = np.repeat(np.arange(len(columns)), [len(t) for t, _ in columns])
    values = np.full((int(new.sum()), len(columns)), np.nan)
    values[row, place] = np.concatenate([value for _, value in columns])
    return t_ns[new], values


def _nth(t_ns: Stamps) -> Stamps:
    """How many samples before each have its stamp; all are in the order of time."""
    at = np.arange(len(t_ns))
    same = np.zeros(len(t_ns), np.bool_)
    same[1:] = t_ns[1:] == t_ns[:-1]
    nth: Stamps = at - np.maximum.accumulate(np.where(same, 0, at))
    return nth
