"""The ledger: every fact, in order, for ever.

Rows are kept by the `eventsourcing` library, in SQLite or a PostgreSQL server (`ingest.facts.ledger_place`). It stores
and orders them, guards each stream by (stream, version) and never sees an event: topics and states are ours
(`ingest.facts.ledger_row`).

Where several programs write at once, what one appends rests on the facts that it asked for last: where another recorded
something in the same stream since then, the append is refused (OvertakenError), and whoever decided asks again.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from datetime import UTC, date, datetime, time, timedelta
from functools import partial
from pathlib import Path
from typing import TypeVar

from eventsourcing.persistence import ApplicationRecorder, Notification, StoredEvent

from ingest.errors import DamageError, IngestError, LedgerError, OvertakenError
from ingest.facts.chain import Head, Tree
from ingest.facts.events import EVENTS, Event, LedgerSealed
from ingest.facts.ledger_history import LedgerHistory, Tail
from ingest.facts.ledger_index import Known, LedgerIndex
from ingest.facts.ledger_lock import WriterLock
from ingest.facts.ledger_place import LedgerPlace, SqliteFile
from ingest.facts.ledger_row import Recorded, decode, encode, utc_text
from ingest.facts.ledger_server import Server, ServerTable

INDEX = "ledger.index"  # beside the ledger, derived from it
SEALS = "ledger-0"  # the stream of the seals
FOR_EVER = "9999"  # after every recorded time
PAGE = 1000  # rows read at once
T = TypeVar("T")


class Ledger:
    """The ledger of the store in `folder`: a file there, which one process writes to at a time, or a table of `server`,
    which several write to beside each other (with `alone`: none beside this one). Any number read meanwhile.

    Raises LedgerError where another process writes, or the database cannot be reached.
    """

    def __init__(
        self,
        folder: Path,
        *,
        write: bool = False,
        create: bool = False,
        server: Server | None = None,
        alone: bool = False,
    ) -> None:
        self.place = placed(folder, server, write, create)
        self.lock = WriterLock(folder / "ledger.lock", shared=self.place.shared and not alone) if write else None
        self._seen = LedgerHistory()
        self._others = _Others()
        self._index: LedgerIndex | None = None
        self._index_path = folder.absolute() / INDEX
        self._closed = False
        try:
            with self.place.plain_words():
                self._left = self.place.stamp()  # as the last command left it
                self.place.recorder()
        except BaseException:
            self.close()
            raise

    def append(self, stream: str, event: Event, *, happened: str | None = None) -> Recorded:
        """Add `event` to `stream`; it is on disk when this returns. Raises as `append_all`."""
        return self.append_all([(stream, event)], happened=happened)[0]

    def append_all(
        self, batch: Sequence[tuple[str, Event]], *, happened: str | None = None, rests_on: tuple[type[Event], ...] = ()
    ) -> list[Recorded]:
        """Add all events of `batch`, or none. Raises LedgerError (refused, nothing stored) and DamageError;
        OvertakenError where another program has recorded an event of one of these streams, or of the kinds that the
        batch `rests_on`, since the facts were asked for last."""
        if self.lock is None:
            raise LedgerError(f"{self.place.where}: was opened for reading: open the store for writing")
        while batch:
            last = self._last()
            position = last.position if last else 0
            if self.place.shared and self._others.asked:
                self._refuse_overtaken({stream for stream, _ in batch}, rests_on, position)
            encoded = self._encoded(batch, last, happened)
            places = self._insert([row for row, _ in encoded], position)
            if places is not None:
                self._others.ours(places)
                return [replace(one, position=place) for (_, one), place in zip(encoded, places, strict=True)]
        return []

    def proposed(self, batch: Sequence[tuple[str, Event]]) -> list[Recorded]:
        """All events, and those of `batch` behind them as if they were recorded. Raises as `append_all`."""
        encoded = self._encoded(batch, self._last(), None)
        events = self.events()
        return [*events, *(replace(one, position=place) for place, (_, one) in enumerate(encoded, len(events) + 1))]

    def take_over(self, rows: Iterable[StoredEvent]) -> None:
        """Store rows of another ledger, as they are, behind those that it has in common with this one. All or none.

        Raises LedgerError.
        """
        last = self._last()
        if self._insert([*rows], last.position if last else 0) is None:
            raise OvertakenError(f"{self.place.where}: another program wrote to it meanwhile: nothing was stored")

    def events(self, *types: type[Event], stream: str | None = None, as_of: str | int | None = None) -> list[Recorded]:
        """The events in order: of `types` (all where none is given), of `stream`, as they were at `as_of`.

        `as_of` is a position, or an ISO 8601 time (UTC where it names no zone), of a date its last moment: what was
        recorded up to then.
        Raises DamageError where the ledger up to there is not what was written, LedgerError for an `as_of` that is
        neither, or a time of which a wrong clock left unknown what was recorded up to then.
        """
        stop, moment = self._as_of(as_of)
        if self._seen.resumed:
            self._seen = LedgerHistory()
        self._read(stop)
        if as_of is None:
            self._others = _Others(self._seen.position)
        elif stop is None:
            _refuse_unknown(as_of, moment, self._seen.recorded)
        return [
            one
            for one in self._seen.recorded
            if isinstance(one.event, types or Event)
            and stream in (None, one.stream)
            and one.recorded <= moment
            and (stop is None or one.position <= stop)
        ]

    def rows(self, start: int | None = None, stop: int | None = None, at_once: int = PAGE) -> Iterator[Notification]:
        """The stored rows from position `start` (None: the first) to `stop`, unchecked, read `at_once`.

        Raises LedgerError.
        """
        while True:
            with self._reading() as recorder:
                page = recorder.select_notifications(start, at_once, stop)
            yield from page
            if len(page) < at_once:
                return
            start = page[-1].id + 1

    def index(self) -> LedgerIndex:
        """Where facts lie in the events up to now. Raises as `events`.

        Only events that came since the last command are read; all of them where something else touched the ledger.
        """
        if self._index is None:
            self._index = self._kept_index() or LedgerIndex()
        self._read()
        self._index.add(self._seen.behind(self._index.position))
        self._others = _Others(self._seen.position)
        return self._index

    def event(self, position: int) -> Recorded:
        """The event at `position`, checked against its own digest. Raises DamageError, and as `rows`."""
        found = self._seen.behind(position - 1)
        if found and found[0].position == position:
            return found[0]
        row = next(self.rows(position, position, 1), None)
        if row is None:
            raise DamageError(f"event {position}: is missing; `whyhot verify` lists all damage")
        return decode(row, position)

    def head(self) -> Head:
        """Position of the last event and Merkle root over all rows up to it. Raises DamageError, and as `rows`."""
        self.index()
        return self._seen.head

    def seal(self) -> Recorded | None:
        """Record the head as an event, so that what is before cannot change unseen. None where nothing is new."""
        return settled(self._seal)

    def _seal(self) -> Recorded | None:
        head = self.head()
        if head.position == 0 or isinstance(self.event(head.position).event, LedgerSealed):
            return None
        return self.append_all([(SEALS, LedgerSealed(position=head.position, root=head.root))], rests_on=(Event,))[0]

    def close(self) -> None:
        """End all connections, keep the index, and let the next writer in. Facts that are asked for later are read."""
        self.place.disconnect()
        self._keep_index()
        self._closed = True
        self.place.only_read()
        if self.lock is not None:
            self.lock.close()
            self.lock = None

    def _refuse_overtaken(self, streams: Collection[str], kinds: tuple[type[Event], ...], position: int) -> None:
        """Raises OvertakenError as `append_all`; `position`: the ledger's end."""
        if position > self._others.position:
            for row in self.rows(self._others.position + 1, position):
                self._others.add(row)
        if self._others.touched(streams, kinds):
            raise OvertakenError(
                f"{self.place.where}: another program recorded the same meanwhile: run the same command again"
            )

    def _encoded(
        self, batch: Sequence[tuple[str, Event]], last: Recorded | None, happened: str | None
    ) -> list[tuple[StoredEvent, Recorded]]:
        """The rows of `batch` behind `last`, the ledger's end, and what each will read as."""
        encoded: list[tuple[StoredEvent, Recorded]] = []
        recorded = last.recorded if last else ""
        tails: dict[str, Recorded | None] = {}
        for stream, event in batch:
            tail = tails[stream] if stream in tails else self._tail(stream)
            recorded = _stamp(after=recorded)
            row, one = encode(event, stream, tail, recorded, happened)
            tails[stream] = one
            encoded.append((row, one))
        return encoded

    def _kept_index(self) -> LedgerIndex | None:
        """The index that the last command left, where the last event that it knows is the one that stands there."""
        kept = LedgerIndex.load(self._index_path, self._left)
        try:
            if kept is None or self.event(kept.position).digest != kept.known.digest:
                return None
        except IngestError:
            return None
        if self._seen.position == 0:
            known = kept.known
            tail_of = partial(self._tail_up_to, kept, kept.position)
            self._seen = LedgerHistory([], [], known.position, Tree(known.tree), known.recorded, tail_of, True)
        return kept

    def _tail_up_to(self, index: LedgerIndex, position: int, stream: str) -> Tail:
        """The last version of `stream` up to `position`, and its digest."""
        events = map(self.event, index.places(stream, position))
        return next(((one.version, one.digest) for one in events if one.stream == stream), (0, None))

    def _keep_index(self) -> None:
        """Keep the index for the next command: what a writer leaves, or a reader had to make."""
        index, seen = self._index, self._seen
        if index is None or seen.findings or seen.halfway:
            return
        if seen.position != index.position or index.position == 0:
            return
        if self.lock is None and index.known.position:
            return
        stamp = self.place.stamp() if self.lock and not self.place.shared else self._left
        index.save(self._index_path, Known(seen.position, index.digest, seen.moment, seen.tree.whole, stamp))

    def _read(self, stop: int | None = None) -> None:
        """See the rows up to `stop` that were not seen yet."""
        seen = self._seen
        for row in self.rows(seen.position + 1 if seen.position else None, stop):
            seen.add(row)
            if seen.findings:
                break
        if seen.findings:
            raise DamageError(f"{seen.findings[0].says}; `whyhot verify` lists all damage")

    def _last(self) -> Recorded | None:
        with self._reading() as recorder:
            position = recorder.max_notification_id()
            rows = recorder.select_notifications(position, 1) if position else []
        return decode(rows[0], rows[0].id) if rows else None

    def _tail(self, stream: str) -> Recorded | None:
        with self._reading() as recorder:
            rows = recorder.select_events(stream, desc=True, limit=1)
        return decode(rows[0], 0) if rows else None

    def _insert(self, rows: Sequence[StoredEvent], after: int) -> Sequence[int] | None:
        """Store `rows` behind `after` in one transaction; a database that is locked is tried once more."""
        try:
            return self._try_insert(rows, after)
        except LedgerError as error:
            if "(database is locked)" not in str(error):
                raise
            return self._try_insert(rows, after)

    def _try_insert(self, rows: Sequence[StoredEvent], after: int) -> Sequence[int] | None:
        with self.place.plain_words():
            return self.place.insert(rows, after)

    def _as_of(self, as_of: str | int | None) -> tuple[int | None, str]:
        """`as_of` as (last position, last recorded time)."""
        if as_of is None:
            return None, FOR_EVER
        last = self._last()
        end = last.position if last else 0
        if isinstance(as_of, int) or as_of.isdecimal():
            if not 0 <= int(as_of) <= end:
                raise LedgerError(f"as of {as_of}: the ledger ends at event {end}: give a number up to that, or a time")
            return int(as_of), FOR_EVER
        try:
            return None, utc_text(_until(as_of))
        except (ValueError, OverflowError):
            raise LedgerError(
                f"as of {as_of!r}: is neither the number of an event (up to {end}) nor a time like 2026-11-21T08:00:00Z"
            ) from None

    @contextmanager
    def _reading(self) -> Iterator[ApplicationRecorder]:
        """The rows, for one reading; of a closed ledger no connection stays."""
        with self.place.plain_words():
            yield self.place.recorder()
        if self._closed:
            self.place.disconnect()


def _until(as_of: str) -> datetime:
    """The time that `as_of` says; a date alone is the whole day. Raises ValueError."""
    try:
        return datetime.combine(date.fromisoformat(as_of), time.max)
    except ValueError:
        return datetime.fromisoformat(as_of)


class _Others:
    """What other programs recorded behind `position`: streams and kinds."""

    def __init__(self, position: int | None = None) -> None:
        self.position = position or 0
        self.asked = position is not None  # else nothing was decided yet that could be overtaken
        self._ours: set[int] = set()
        self._streams: set[str] = set()
        self._topics: set[str] = set()

    def ours(self, places: Iterable[int]) -> None:
        """Take note of positions that hold what this program recorded itself."""
        self._ours.update(places)

    def add(self, row: Notification) -> None:
        self.position = row.id
        if row.id not in self._ours:
            self._streams.add(str(row.originator_id))
            self._topics.add(row.topic)

    def touched(self, streams: Collection[str], kinds: tuple[type[Event], ...]) -> bool:
        """Whether others recorded something of these streams or kinds."""
        same = any(issubclass(EVENTS.get(topic, Event), kinds) for topic in self._topics)
        return same or not self._streams.isdisjoint(streams)


def settled(decide: Callable[[], T]) -> T:
    """What `decide` returns, which asks for facts, makes events of them and appends them: asked again where another
    program recorded something in between."""
    while True:
        try:
            return decide()
        except OvertakenError:
            continue


def placed(folder: Path, server: Server | None, write: bool, create: bool) -> LedgerPlace:
    """Where the rows of the ledger of the store in `folder` lie."""
    if server is not None:
        return ServerTable(server, create)
    return SqliteFile(folder / "ledger.sqlite", write, create)


def ahead(recorded: Sequence[Recorded]) -> Recorded | None:
    """The first of these events, all those of a ledger, that says it was recorded later than now, by a day at least: a
    clock was wrong, and the times of all after it are no more than their order."""
    now = utc_text(datetime.now(UTC) + timedelta(days=1))
    first = bisect_right(recorded, now, key=lambda one: one.recorded)
    return recorded[first] if first < len(recorded) else None


def _refuse_unknown(as_of: str | int, moment: str, recorded: Sequence[Recorded]) -> None:
    """Raises LedgerError for a time behind the last right one and before that of an event which is `ahead`."""
    one = ahead(recorded)
    if one and moment < one.recorded and not any(moment <= other.recorded for other in recorded[: one.position - 1]):
        raise LedgerError(
            f"as of {as_of!r}: event {one.position} says it was recorded on {one.recorded[:10]}, so a clock was wrong, "
            f"and times no longer tell what was known when: give the number of an event (up to {len(recorded)})"
        )


def _stamp(after: str) -> str:
    """Now, but at least 1 us after `after` even where the clock was set back, or another machine's is ahead, so that a
    time is one position."""
    now = utc_text(datetime.now(UTC))
    return max(now, utc_text(datetime.fromisoformat(after) + timedelta(microseconds=1))) if after else now
