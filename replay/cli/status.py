"""`whyhot` alone: what is in the store at hand, and what to type next."""

from __future__ import annotations

import shlex
from pathlib import Path

from ingest.texts.names import handle


def status(folder: Path) -> str | None:
    """What the store in `folder` holds, what was last found, and the next command; None where there is no store."""
    if not (folder / "store.json").is_file():
        return None
    from ingest.facts import facts
    from ingest.facts.store import Store
    from replay.show.words.words import counted
    from whyhot import __version__

    with Store.open(folder) as store:
        known, head = facts.at(store.ledger), store.ledger.head()
    motors = len({model.motor for model in known.models.values()})
    replayed = {run.session for run in known.runs.values()}
    waiting = [session for session in known.sessions if session.session not in replayed]
    size = sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())
    if not known.sessions:
        command = "whyhot ingest FILE... --bench bench.toml"
    else:
        verb, session = ("replay", waiting[0]) if waiting and motors else ("show", known.sessions[-1])
        command = f"whyhot {verb} {shlex.quote(session.name)}"
    held = f"{counted(len(known.sessions), 'session')}, {counted(motors, 'motor')}, {size / 1e6:.1f} MB"
    held += f" here and the files in {store.mark.files}" if store.mark.files else ""
    lines = [
        f"whyhot {__version__} · store {folder} · {held} · head {head.position}:{handle(head.root)}",
        f"{counted(len(known.sessions) - len(waiting), 'session')} replayed, {len(waiting)} not yet",
    ]
    if known.diagnoses:
        last = list(known.diagnoses.values())[-1]
        found = ", ".join(last.summary.get("causes", ())) or "no cause named"
        lines.append(f"last diagnosis: d-{last.diagnosis[:8]} of {last.summary.get('motor', 'a motor')}: {found}")
    return "\n".join([*lines, f"next: {command} · whyhot --help"])
