"""What became of every record of a log: found = decoded + unknown_id + wrong_length + rejected."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

from ingest.errors import IngestError
from ingest.formats import ERROR, Rejected
from ingest.frames import FrameBatch
from ingest.reading import Reading
from ingest.recording import id_text

SHOWN = 20  # of the first rejected records, and of the most frequent reasons


@dataclass
class Account:
    """Counts what is not decoded. Keys: "can1:0x123", with the message's name behind it where the length is wrong."""

    unknown_id: Counter[str] = field(default_factory=Counter)
    wrong_length: Counter[str] = field(default_factory=Counter)
    rejected: Counter[str] = field(default_factory=Counter)  # by reason
    first_rejected: list[Rejected] = field(default_factory=list)

    def reject(self, batch: FrameBatch) -> None:
        """Count the remote and error frames of a batch: they hold no data."""
        frames, at = batch.frames, batch.without_data
        errors = (frames.flags[at] & ERROR) != 0
        for why, places in (("error frame, no data", at[errors]), ("remote frame, no data", at[~errors])):
            self.rejected[why] += len(places)
            for i in places[:SHOWN].tolist():
                where = id_text(int(frames.bus[i]), int(frames.can_id[i]))
                self.first_rejected.append(Rejected(int(frames.record[i]), where, why))
        self.first_rejected = sorted(self.first_rejected, key=lambda entry: entry.record)[:SHOWN]

    def rejections(self, reading: Reading) -> list[dict[str, Any]]:
        """The first rejected records, those that the reader of the log refused included."""
        entries = sorted([*reading.rejections, *self.first_rejected], key=lambda entry: entry.record)
        return [{"record": entry.record, "where": entry.where, "why": entry.why} for entry in entries[:SHOWN]]

    def reasons(self, refused: Iterable[Rejected]) -> dict[str, int]:
        """Reason -> records, the most frequent first; `refused` are those of the reader."""
        return dict((+self.rejected + Counter(entry.why for entry in refused)).most_common(SHOWN))

    def balance(self, reading: Reading, decoded: int) -> dict[str, int]:
        """The balance of the log. `decoded` are the rows written. Raises IngestError where it does not hold."""
        counted = {
            "decoded": decoded,
            "unknown_id": self.unknown_id.total(),
            "wrong_length": self.wrong_length.total(),
            "rejected": reading.rejected + self.rejected.total(),
        }
        if reading.found != sum(counted.values()):
            parts = " + ".join(f"{name} {count:,}" for name, count in counted.items())
            raise IngestError(
                f"the log holds {reading.found:,} records, but {parts} are {sum(counted.values()):,}: some were lost or "
                "counted twice. This is a defect of whyhot: report it with the log."
            )
        return {"found": reading.found, **counted}


def outcome(reading: Reading, balance: dict[str, int]) -> tuple[str, str | None]:
    """("decoded" or "salvaged", the line that says why the log was not decoded whole, without the file's name)."""
    if reading.cut:
        return "salvaged", f"{reading.cut}; the {reading.written:,} records before that were kept"
    if reading.rejected:
        first = min(reading.rejections, key=lambda entry: entry.record)
        return "salvaged", (
            f"{reading.rejected:,} of {reading.found:,} records cannot be read and were set aside, the first at "
            f"{first.where}: {first.why}"
        )
    if reading.found and balance["unknown_id"] == reading.found - balance["rejected"]:
        return "decoded", "no frame is of a message that is known: name the signal database with --dbc"
    return "decoded", None
