"""What `whyhot backup` and `restore` answer: what was copied, what was there already, and the head that is held now."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Any

from replay.show.words.terminal import labelled
from replay.show.words.words import counted, size

if TYPE_CHECKING:
    from ingest.facts.backup import Amount, Copied
    from ingest.facts.store_check import StoreCheck
    from ingest.facts.sweeping import Swept


def copied_json(done: Copied) -> dict[str, Any]:
    """`head`: what the copy holds now; `left`: a line for each sealed file that could not be copied; `removed` from the
    copy, of logs that were forgotten."""
    return {
        "copied": done.copied._asdict(),
        "there": done.there._asdict(),
        "head": vars(done.head),
        "left": list(done.left),
        "removed": done.swept._asdict(),
    }


def backed_up_text(done: Copied, folder: Path) -> str:
    """The answer, and how the backup is checked; where something was left, how that is mended first."""
    lines = labelled("Backed up", _amount(done.copied)) + labelled("There already", _amount(done.there))
    lines += removed(done.swept)
    lines += [*labelled("Head", str(done.head)), *_left(done), ""]
    step = "whyhot verify --read" if done.left else f"whyhot verify --store {shlex.quote(str(folder))} --read"
    return "\n".join(lines + labelled("Next", step))


def restored_text(done: Copied, found: StoreCheck, folder: Path) -> str:
    """The answer; samples and warehouse, which no backup holds, are made again next."""
    good, of = found.whole["sealed files"]
    lines = labelled("Restored", _amount(done.copied))
    if done.there.files:  # of a restore that was stopped
        lines += labelled("There already", _amount(done.there))
    lines += labelled("Head", str(done.head))
    lines += labelled("Checked", f"every event, and every byte of {good:,} of {of:,} sealed files")
    lines += [*_left(done), "", *labelled("Next", f"whyhot rebuild --store {shlex.quote(str(folder))}")]
    return "\n".join(lines)


def removed(swept: Swept) -> list[str]:
    """How much is gone for good, no line where nothing is."""
    what = f"{counted(swept.files, 'file')} of {size(swept.bytes)}, of logs that were forgotten"
    return labelled("Removed", what) if swept.files else []


def _amount(much: Amount) -> str:
    if much.events == much.files == 0:
        return "nothing"
    return f"{counted(much.events, 'event')} and {counted(much.files, 'sealed file')} of {size(much.bytes)}"


def _left(done: Copied) -> list[str]:
    if not done.left:
        return []
    return labelled("Not copied", f"{counted(len(done.left), 'sealed file')}, in the lines above; all else was")
