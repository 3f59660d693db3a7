"""Facts of now as mappings that read an event from the ledger when it is asked for, and no other."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, Generic, TypeVar, overload

from ingest.facts.events import Event, SessionRecorded, SessionRegrouped
from ingest.facts.ledger import Ledger
from ingest.facts.ledger_index import BEGINS, LedgerIndex, keys_of
from ingest.facts.ledger_row import Recorded

E = TypeVar("E", bound=Event)
V = TypeVar("V")
T = TypeVar("T")


class View:
    """The events that `index` knows by now, found by what they are about; what comes later is not seen."""

    def __init__(self, ledger: Ledger, index: LedgerIndex) -> None:
        self._ledger = ledger
        self._index = index
        self._until = index.position
        self._read: dict[int, Recorded] = {}

    def every(self) -> list[Recorded]:
        """All events, each checked against all before it."""
        return self._ledger.events(as_of=self._until)

    def few(self) -> list[Recorded]:
        """All events of the kinds of which there are few (`ledger_index.MANY` are the others)."""
        return self._at(self._index.few(self._until))

    def about(self, *keys: str) -> list[Recorded]:
        """The events about any of `keys` (`ledger_index.keys_of`), in order."""
        read = self._at(sorted({place for key in keys for place in self._index.places(key, self._until)}))
        return [one for one in read if not keys_of(one).isdisjoint(keys)]

    def last(self, key: str, kind: type[E]) -> E | None:
        """The last event of `kind` about `key`."""
        read = map(self._event, self._index.places(key, self._until))
        return next((one.event for one in read if isinstance(one.event, kind) and key in keys_of(one)), None)

    def session(self, session: str) -> SessionRecorded | SessionRegrouped | None:
        """What became of the session of this id last."""
        of = [one.event for one in self.about(f"session-{session}")]
        return next((one for one in reversed(of) if isinstance(one, SessionRecorded | SessionRegrouped)), None)

    def sessions_like(self, text: str) -> list[Recorded]:
        """The events of all sessions that have, or had, this name or an id that begins so, and of what they became."""
        found: dict[int, Recorded] = {}
        keys = {f"name {text}", f"begins {text.lower()[:BEGINS]}"}
        while keys:
            new = [one for one in self.about(*keys) if one.position not in found]
            found |= {one.position: one for one in new}
            keys = {one.stream for one in new}
            keys |= {f"session-{one.event.into}" for one in new if isinstance(one.event, SessionRegrouped)}
        return [found[position] for position in sorted(found)]

    @property
    def index(self) -> LedgerIndex:
        """What it says of the current sessions, as long as nothing came since."""
        assert self._index.position == self._until, "these facts are not those of now"
        return self._index

    def sessions(self, positions: Iterable[int]) -> list[SessionRecorded]:
        """What was recorded of sessions at these positions."""
        return [one.event for one in self._at(positions) if isinstance(one.event, SessionRecorded)]

    def _at(self, positions: Iterable[int]) -> list[Recorded]:
        return [self._event(position) for position in positions]

    def _event(self, position: int) -> Recorded:
        if position not in self._read:
            self._read[position] = self._ledger.event(position)
        return self._read[position]


class Whole(Generic[T]):
    """All facts, folded from every event when they are first asked for."""

    def __init__(self, fold: Callable[[], T]) -> None:
        self._fold = fold
        self.made: T | None = None

    def __call__(self) -> T:
        if self.made is None:
            self.made = self._fold()
        return self.made


class Lookup(Mapping[str, V]):
    """What `find` gives for a key (None: nothing). Whoever goes through all of it reads every event: `name` of `whole`,
    where it is looked up from then on."""

    def __init__(self, whole: Whole[Any], name: str, find: Callable[[str], V | None]) -> None:
        self._whole = whole
        self._name = name
        self._find = find

    def __getitem__(self, key: str) -> V:
        if self._whole.made is not None:
            return self._all()[key]
        found = self._find(key)
        if found is None:
            raise KeyError(key)
        return found

    def __iter__(self) -> Iterator[str]:
        return iter(self._all())

    def __len__(self) -> int:
        return len(self._all())

    def _all(self) -> Mapping[str, V]:
        found: Mapping[str, V] = getattr(self._whole(), self._name)
        return found


class Sessions(Sequence[SessionRecorded]):
    """The current sessions in order. Whoever goes through them reads every event."""

    def __init__(self, whole: Whole[Any], find: Callable[[str], Event | None]) -> None:
        self._whole = whole
        self._find = find

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Sequence) and list(self) == list(other)

    def __contains__(self, session: object) -> bool:
        return isinstance(session, SessionRecorded) and self._find(session.session) == session

    @overload
    def __getitem__(self, place: int) -> SessionRecorded: ...
    @overload
    def __getitem__(self, place: slice) -> Sequence[SessionRecorded]: ...
    def __getitem__(self, place: int | slice) -> SessionRecorded | Sequence[SessionRecorded]:
        return self._all()[place]

    def __iter__(self) -> Iterator[SessionRecorded]:
        return iter(self._all())

    def __len__(self) -> int:
        return len(self._all())

    def _all(self) -> Sequence[SessionRecorded]:
        found: Sequence[SessionRecorded] = self._whole().sessions
        return found
