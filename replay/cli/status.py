"""`whyhot` alone: what is in the store at hand, and what to type next."""

from __future__ import annotations

from pathlib import Path


def status(folder: Path) -> str | None:
    """Two lines on the store in `folder` and the next command; None where there is no store."""
    if not (folder / "store.json").is_file():
        return None
    from ingest import facts
    from ingest.store import Store
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
        command = f"whyhot replay {waiting[0].name}" if waiting and motors else f"whyhot show {known.sessions[-1].name}"
    head_line = (
        f"whyhot {__version__} · store {folder} · {len(known.sessions)} sessions, {motors} motors, {size / 1e6:.1f} MB"
    )
    return "\n".join(
        [
            f"{head_line} · head {head.position}:{head.root[:12]}",
            f"{len(known.sessions) - len(waiting)} sessions replayed, {len(waiting)} not yet",
            f"next: {command}   (whyhot --help lists all verbs)",
        ]
    )
