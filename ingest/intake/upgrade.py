"""A store that an earlier version wrote: what is read otherwise by this one, and its logs decoded anew.

Events and sealed bytes stay as they are, for ever: an event of an earlier version is read as it would be written today
(`ingest.facts.events`). Samples are made by a decoder, and its version is part of their id.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from ingest.facts import facts as ledger_facts
from ingest.facts.facts import Facts
from ingest.facts.ledger_row import Recorded
from ingest.facts.sessions import Override
from ingest.facts.store import Store
from ingest.intake.corrections import alike, plan_of, read_again
from ingest.intake.setup import MotorFile
from ingest.log.decode import is_made_here, newer


@dataclass(frozen=True)
class Upgrade:
    """`events`: program that wrote them -> how many; `logs`: SHA-256 -> the decoder of those whose samples an earlier
    version made; `left`: a line for each whose samples a later version made, which stay as they are."""

    events: Mapping[str, int]
    logs: Mapping[str, str]
    left: Sequence[str]


def needed(recorded: Sequence[Recorded], facts: Facts) -> Upgrade:
    """What in a store is of another version."""
    logs = decoded_elsewhere(facts)
    later = {raw: why for raw, decoder in logs.items() if (why := newer(decoder))}
    earlier = {raw: decoder for raw, decoder in logs.items() if raw not in later}
    left = [f"{facts.files[raw].name}: {why}" for raw, why in later.items()]
    return Upgrade(Counter(one.code for one in recorded), earlier, left)


def decoded_elsewhere(facts: Facts) -> dict[str, str]:
    """SHA-256 -> decoder of the logs of sessions whose samples another version made."""
    latest = {one.raw: one for one in facts.decodes.values() if one.outcome != "quarantined"}
    held = {file["raw"] for session in facts.sessions for file in session.files}
    return {raw: one.decoder for raw, one in latest.items() if raw in held and not is_made_here(one.decoder)}


def upgrade(
    store: Store, logs: Sequence[str], motor_file: Callable[[Path], MotorFile], tell: Callable[[str], None]
) -> list[str]:
    """Decode these logs (SHA-256) again from their sealed bytes, with what they were read with before. Returns a line
    for each that could not be. Raises as `correct`."""
    facts = ledger_facts.at(store.ledger)
    plans = [plan_of(store, facts, raw, Override(), (None, ()), motor_file) for raw in logs]
    return [line for same in alike(plans) for line in read_again(store, facts, same, tell, [])]
