"""A folder of pages, kept up to date as it may lie on a share: what is as it was is left alone.

A page is written where it is not there, or was made of something else than it would be made of now; what each was made
of lies beside them in `RECORD`. `site_pages` says which pages there are, `site_index` draws the first.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from ingest.errors import IngestError
from ingest.facts.store import MARK
from replay.errors import ReplayDataError
from replay.written import write, written

RECORD = "pages.json"
INDEX = "index.html"
OURS = re.compile(r"(sessions/[0-9a-f]+|diagnoses/d-[0-9a-f]+|ageing)\.html")  # all that is ever taken away

Course = Sequence[float | None]  # a residual [K] over a session, None where there is no sample


@dataclass(frozen=True)
class PageWanted:
    """A page that belongs into the folder. `key`: hash of what it is made of; `write`: writes it to a path and gives
    the course that the index draws beside its link."""

    key: str
    write: Callable[[Path], Course]


@dataclass(frozen=True)
class PageMade:
    """A page that lies in the folder."""

    key: str
    course_K: Course = ()


@dataclass(frozen=True)
class SiteWritten:
    """What became of the pages, by their paths in the folder, and a line for each that could not be made."""

    written: list[str] = field(default_factory=list)
    kept: list[str] = field(default_factory=list)
    removed: list[str] = field(default_factory=list)
    refused: list[str] = field(default_factory=list)


def write_site(
    folder: Path,
    wanted: Mapping[str, PageWanted],
    index: Callable[[Mapping[str, Course]], str],
    tell: Callable[[str], None] = lambda _: None,
) -> SiteWritten:
    """Bring `folder` up to the pages `wanted` by path; `index`: the text of the first, from the paths of those that are
    there with their courses. A page whose bytes are damaged is refused and the others are written. Raises
    ReplayDataError where `folder` is a store."""
    if (folder / MARK).exists():
        raise ReplayDataError(f"{folder}: is a store: give --out a folder for pages alone.")
    done, before, made = SiteWritten(), _recorded(folder), dict[str, PageMade]()
    for number, (path, page) in enumerate(wanted.items(), 1):
        if path in before and before[path].key == page.key and (folder / path).is_file():
            made[path] = before[path]
            done.kept.append(path)
            continue
        tell(f"{path}, {number} of {len(wanted)}")
        try:
            with written(folder / path) as part:
                course = page.write(part)
            made[path] = PageMade(page.key, course)
            done.written.append(path)
        except IngestError as error:
            done.refused.append(f"{path}: {error}")
    done.removed.extend(_remove(folder, [path for path in before if path not in made]))
    record = json.dumps({path: asdict(page) for path, page in sorted(made.items())})
    for name, text in ((INDEX, index({path: page.course_K for path, page in made.items()})), (RECORD, record)):
        (done.written if _put(folder / name, text) else done.kept).append(name)
    return done


def _recorded(folder: Path) -> Mapping[str, PageMade]:
    """The pages as the record tells of them; none where it cannot be read: then all are written."""
    try:
        said = json.loads((folder / RECORD).read_text(encoding="utf-8"))
        return {path: PageMade(str(one["key"]), _numbers(one["course_K"])) for path, one in said.items()}
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return {}


def _numbers(said: list[Any]) -> Course:
    return [None if one is None else float(one) for one in said]


def _put(target: Path, text: str) -> bool:
    """Whether the text had to be written: it may be there already."""
    if target.is_file() and target.read_bytes() == text.encode():
        return False
    write(target, text)
    return True


def _remove(folder: Path, paths: Sequence[str]) -> list[str]:
    """Take away pages that are no more; a record that names anything else leads to nothing."""
    ours = [path for path in paths if OURS.fullmatch(path)]
    for path in ours:
        (folder / path).unlink(missing_ok=True)
    return ours
