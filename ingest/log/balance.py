"""What became of every record of a log: found = decoded + unknown_id + wrong_length + rejected."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from ingest.errors import IngestError
from ingest.facts.events import COUNTS
from ingest.formats import Rejected
from ingest.log.frames import FrameBatch
from ingest.log.parameter_groups import BROKEN
from ingest.log.reading import LogReading
from ingest.log.recording import id_text

SHOWN = 20  # of the first rejected records, and of the most frequent reasons
TO_DO = {
    "rows": "correct the cells and ingest the file again",
    "frames": "copy the file again if the original is whole",
}
REMOTE_FRAME = "remote frame, no data"
NO_DATA = ("error frame", REMOTE_FRAME, BROKEN)  # reasons that are the bus's way, not damage of the log


@dataclass
class Account:
    """Counts what is not decoded. Keys: "can1:0x123", with the message's name behind it where the length is wrong."""

    unknown_id: Counter[str] = field(default_factory=Counter)
    wrong_length: Counter[str] = field(default_factory=Counter)
    rejected: Counter[str] = field(default_factory=Counter)  # by reason
    first_rejected: list[Rejected] = field(default_factory=list)
    first_unreadable: Rejected | None = None
    not_available: Counter[str] = field(default_factory=Counter)  # "message.signal" -> how often it says so
    errors: Counter[str] = field(default_factory=Counter)  # and how often that there is an error
    carried: int = 0  # frames that were decoded, beyond one for each row: packets of longer messages

    def refuse(self, refused: Iterable[Rejected]) -> None:
        """Count what the reader of the log refused."""
        for i, entry in enumerate(refused):
            self.rejected[entry.why] += 1
            if i < SHOWN:
                self.first_rejected.append(entry)
            if self.first_unreadable is None and entry.why not in NO_DATA:
                self.first_unreadable = entry

    def reject(self, batch: FrameBatch) -> None:
        """Count the remote frames of a batch: they hold no data."""
        frames = batch.frames
        self.rejected[REMOTE_FRAME] += len(batch.remote)
        for i in batch.remote[:SHOWN].tolist():
            where = id_text(int(frames.bus[i]), int(frames.can_id[i]))
            self.first_rejected.append(Rejected(int(frames.record[i]), where, REMOTE_FRAME))
        self.first_rejected = sorted(self.first_rejected, key=lambda entry: entry.record)[:SHOWN]

    def break_off(self, broken: Mapping[int, int]) -> None:
        """Count the frames of messages that are not whole: first record -> frames."""
        for i, (record, frames) in enumerate(broken.items()):
            self.rejected[BROKEN] += frames
            if i < SHOWN:
                self.first_rejected.append(Rejected(record, f"record {record + 1:,}", BROKEN))

    def missing(self, batch: FrameBatch) -> None:
        """Count the values of a batch that say that there is none."""
        self.not_available += batch.not_available
        self.errors += batch.errors

    def rejections(self) -> list[dict[str, Any]]:
        """The first rejected records, in the order of the log."""
        entries = sorted(self.first_rejected, key=lambda entry: entry.record)[:SHOWN]
        return [{"record": entry.record, "where": entry.where, "why": entry.why} for entry in entries]

    def reasons(self) -> dict[str, int]:
        """Reason -> rejected records, the most frequent first."""
        return dict((+self.rejected).most_common(SHOWN))

    def balance(self, reading: LogReading, decoded: int) -> dict[str, int]:
        """The balance of the log. `decoded` are the rows written. Raises IngestError where it does not hold."""
        others = (self.unknown_id.total(), self.wrong_length.total(), self.rejected.total())
        counted = dict(zip(COUNTS, (decoded + self.carried, *others), strict=True))
        if reading.found != sum(counted.values()):
            parts = " + ".join(f"{name} {count:,}" for name, count in counted.items())
            raise IngestError(
                f"the log holds {reading.found:,} records, but {parts} are {sum(counted.values()):,}: "
                "some were lost or counted twice. This is a defect of whyhot: report it with the log."
            )
        return {"found": reading.found, **counted}


def outcome(
    reading: LogReading, account: Account, balance: dict[str, int], databases: Sequence[str] = ()
) -> tuple[str, str | None]:
    """("decoded" or "salvaged", the line that says why the log was not decoded whole, without the file's name).
    `databases`: the names of those it was read with."""
    if reading.cut:
        return "salvaged", reading.cut
    if first := account.first_unreadable:
        unreadable = account.rejected.total() - sum(account.rejected[why] for why in NO_DATA)
        return "salvaged", (
            f"{unreadable:,} of {reading.found:,} records cannot be read and were set aside, the first at "
            f"{first.where}: {first.why}; {TO_DO[reading.holds]}, or leave it so: the rest is used."
        )
    return "decoded", None if balance["decoded"] or not reading.found else _nothing(balance, databases)


def _nothing(balance: dict[str, int], databases: Sequence[str]) -> str:
    if balance["wrong_length"]:
        known = " of a message that is known" if balance["unknown_id"] else ""
        return f"every frame{known} is shorter than its message: the signal database is not the one of this log"
    if balance["unknown_id"]:
        more = [f"{len(databases) - 3} more"] if len(databases) > 3 else []
        known = f"of {', '.join([*databases[:3], *more])}" if databases else "that is known"
        return f"no frame is of a message {known}: name the signal database of this log with --dbc"
    return "no frame holds data: nothing to decode"
