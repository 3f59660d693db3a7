"""Pages that cannot go stale. Run as a script it writes docs/cli.md; run by pytest it checks it.

python tests/test_docs.py
"""

from __future__ import annotations

import argparse
import re
from functools import partial
from importlib import import_module

import pytest

from ingest.formats import SUFFIXES
from made.places import ROOT
from replay.cli import VERBS, build_parser

PAGE = ROOT / "docs" / "cli.md"
HEAD = """# The command line

Written by `python tests/test_docs.py`; `whyhot VERB --help` prints the same. Every verb takes `--store DIR` (default: `WHYHOT_STORE`,
else `./whyhot-store`) and `--json [FILE.json]`. Exit codes: 0 done; 1 done with something refused or quarantined; 2 could not start
or stopped before its end; 130 interrupted. Answers go to standard output, refusals and warnings to standard error, a line each.
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


def test_the_reference_of_verbs_is_what_the_program_says() -> None:
    assert PAGE.read_text(encoding="utf-8") == page(), "run: python tests/test_docs.py"


def test_the_formats_that_pages_list_are_those_that_are_read() -> None:
    page = (ROOT / "docs" / "limitations.md").read_text(encoding="utf-8")
    listed = re.search(r"\*\*Read:\*\*(.*?)\*\*Not yet:", page, flags=re.DOTALL)
    assert listed
    assert re.findall(r"`(\.[a-z.]+)`", listed[1]) == SUFFIXES.split()


@pytest.mark.parametrize("verb", sorted(VERBS))
def test_every_verb_is_one_file_with_arguments_and_run(verb: str) -> None:
    module = import_module(f"replay.cli.{verb}")
    assert callable(module.arguments)
    assert callable(module.run)
    assert f"`whyhot {verb}" in (module.__doc__ or "")


def test_every_link_of_the_pages_leads_somewhere() -> None:
    pages = [ROOT / "README.md", ROOT / "ARCHITECTURE.md", *sorted((ROOT / "docs").glob("*.md"))]
    links = [(p, link) for p in pages for link in re.findall(r"\]\(([^)#:]+)[^):]*\)", p.read_text(encoding="utf-8"))]
    assert links
    for source, link in links:
        assert (source.parent / link).exists(), f"{source.name}: {link}"


def test_pages_speak_of_verbs_that_exist() -> None:
    for source in [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]:
        for verb in re.findall(r"^\$? ?whyhot ([a-z]+)", source.read_text(encoding="utf-8"), flags=re.MULTILINE):
            assert verb in VERBS, f"{source.name}: whyhot {verb}"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
