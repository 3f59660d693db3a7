"""Pages that cannot go stale. A script too: it writes docs/cli.md and the tables of rooms in ARCHITECTURE.md.

python tests/test_docs.py
"""

from __future__ import annotations

import argparse
import pkgutil
import re
import subprocess
from functools import partial
from importlib import import_module
from pathlib import Path

import pytest

from ingest.formats import SUFFIXES
from made.places import ROOT
from made.rooms import below, docstring
from replay.cli import VERBS, build_parser
from replay.studies.diagnosis.question import LEAST_S

PAGE = ROOT / "docs" / "cli.md"
HEAD = """# The command line

Written by `python tests/test_docs.py`; `whyhot VERB --help` prints the same. Every verb takes `--store DIR` (default:
`WHYHOT_STORE`, else `./whyhot-store`) and `--json [FILE.json]`. Exit codes: 0 done; 1 done with something refused or
quarantined; 2 could not start or stopped before its end; 130 interrupted. Answers go to standard output, refusals and
warnings to standard error, a line each. Where a terminal or pipe cannot show a character, `-`, `deg`, `Ohm` or its code
(`\\xfc`) is printed instead; JSON escapes it, and reads back unchanged.
"""


def page() -> str:
    """The reference of all verbs."""
    return HEAD + "".join(f"\n## whyhot {verb}\n\n```\n{_help(verb)}```\n" for verb in VERBS)


def _help(verb: str) -> str:
    parser = build_parser(verb)
    actions = parser._subparsers._group_actions  # type: ignore[union-attr]
    sub = actions[0].choices[verb]  # type: ignore[index]
    sub.formatter_class = partial(argparse.HelpFormatter, width=100)
    text: str = sub.format_help()
    return text


ARCHITECTURE = ROOT / "ARCHITECTURE.md"
ROOMS = re.compile(r"(<!-- rooms of (\w+):.*? -->\n).*?(<!-- end of rooms -->)", re.DOTALL)
CELL_WORDS = 40  # a longer cell of ARCHITECTURE.md is a paragraph, and belongs into the docstring of its room
PAGE_WORDS = 2500  # ten minutes


def architecture() -> str:
    """ARCHITECTURE.md with its tables of rooms as the folders' docstrings say them."""
    return ROOMS.sub(lambda part: part[1] + _rooms(part[2]) + part[3], ARCHITECTURE.read_text(encoding="utf-8"))


def _rooms(package: str) -> str:
    rows = ["| room | what it holds |", "|---|---|"]
    for folder in below(ROOT / package):
        rows.append(f"| `{folder.relative_to(ROOT).as_posix()}` | {docstring(folder).splitlines()[0]} |")
    return "\n".join([*rows, ""])


def test_the_tables_of_rooms_are_what_the_folders_say() -> None:
    page = ARCHITECTURE.read_text(encoding="utf-8")
    assert len(ROOMS.findall(page)) == 4
    assert page == architecture(), "run: python tests/test_docs.py"


def test_no_cell_of_the_architecture_is_a_paragraph() -> None:
    rows = [line for line in ARCHITECTURE.read_text(encoding="utf-8").splitlines() if line.startswith("|")]
    assert len(rows) > 50
    for cell in (cell for row in rows for cell in row.split("|")):
        assert len(cell.split()) <= CELL_WORDS, cell


def test_the_architecture_is_read_in_ten_minutes() -> None:
    words = [word for word in ARCHITECTURE.read_text(encoding="utf-8").split() if re.search(r"\w", word)]
    assert 1000 < len(words) <= PAGE_WORDS


def test_the_reference_of_verbs_is_what_the_program_says() -> None:
    assert PAGE.read_text(encoding="utf-8") == page(), "run: python tests/test_docs.py"


def test_the_formats_that_pages_list_are_those_that_are_read() -> None:
    page = (ROOT / "docs" / "limitations.md").read_text(encoding="utf-8")
    listed = re.search(r"\*\*Read:\*\*(.*?)\*\*Not yet:", page, flags=re.DOTALL)
    assert listed
    assert re.findall(r"`(\.[a-z0-9.]+)`", listed[1]) == SUFFIXES.split()


@pytest.mark.parametrize("verb", sorted(VERBS))
def test_every_verb_is_one_file_with_arguments_and_run(verb: str) -> None:
    module = import_module(f"replay.cli.{verb}")
    assert callable(module.arguments)
    assert callable(module.run)
    assert f"`whyhot {verb}" in (module.__doc__ or "")


PAGES = [
    *(ROOT / f"{name}.md" for name in ("README", "ARCHITECTURE", "CONTRIBUTING", "SECURITY")),
    *sorted((ROOT / "docs").glob("*.md")),
]
HOUSE = ("twin", "ingest", "analytics", "replay", "whyhot", "tests", "benchmarks", "notebooks", "examples")
FILE = re.compile(rf"(?<![\w/.-])(?:{'|'.join(HOUSE)})/[\w./*-]*\w")
NAME = re.compile(r"(?<![\w/.-])(?:twin|ingest|analytics|replay|whyhot)(?:\.(?!json)\w+)+(?![\w/-])")


@pytest.mark.parametrize("source", PAGES, ids=lambda source: source.name)
def test_every_file_and_module_that_a_page_names_is_there(source: Path) -> None:
    text = source.read_text(encoding="utf-8")
    for path in FILE.findall(text):
        assert list(ROOT.glob(path)), path
    for dotted in NAME.findall(text):
        assert pkgutil.resolve_name(dotted) is not None, dotted
    ours = {path.name for folder in HOUSE for path in (ROOT / folder).rglob("*.py")}
    assert set(re.findall(r"`(\w+\.py)`", text)) <= ours


def test_every_link_of_the_pages_leads_somewhere() -> None:
    links = [(p, link) for p in PAGES for link in re.findall(r"\]\(([^)#:]+)[^):]*\)", p.read_text(encoding="utf-8"))]
    assert links
    for source, link in links:
        assert (source.parent / link).exists(), f"{source.name}: {link}"


def test_the_commits_that_are_shown_as_examples_are_there() -> None:
    def git(*words: str) -> str:
        return subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True, check=False).stdout

    if git("rev-parse", "--is-shallow-repository").strip() != "false":
        pytest.skip("a copy without the history")
    page = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    examples = re.findall(r"\| `([0-9a-f]{7})` (.*?) \|$", page, flags=re.MULTILINE)
    assert len(examples) >= 6
    for commit, title in examples:
        assert git("log", "-1", "--format=%s", commit, "--").strip() == title


def test_pages_speak_of_verbs_that_exist() -> None:
    for source in [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]:
        for verb in re.findall(r"^\$? ?whyhot ([a-z]+)", source.read_text(encoding="utf-8"), flags=re.MULTILINE):
            assert verb in VERBS, f"{source.name}: whyhot {verb}"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
    ARCHITECTURE.write_text(architecture(), encoding="utf-8")


def test_the_least_time_to_learn_from_is_one_number() -> None:
    least = f"{LEAST_S / 60:.0f} min"
    lines = ("least time to learn from | {}", "needs at least {} to learn from", "sessions to learn from, {} at least")
    for page, line in zip(("how_it_decides", "limitations", "diagnosis"), lines, strict=True):
        assert line.format(least) in (ROOT / "docs" / f"{page}.md").read_text(encoding="utf-8")
