"""Every benchmark runs to its end, and prints the figures that the pages quote of it."""

from __future__ import annotations

import re
from collections import defaultdict
from pathlib import Path

import pytest

from made.as_script import ran
from made.places import ROOT

BENCHMARKS = sorted(path.stem for path in (ROOT / "benchmarks").glob("*.py") if path.stem not in ("asked", "shared"))
PAGES = (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")))
# "`python benchmarks/NAME.py` prints `this` and `that`", and the names in the first column of a table below it.
COMMAND = re.compile(r"benchmarks/(\w+)\.py[^`\n]*`?\s+prints\s+((?:`[^`]+`(?:,\s+|\s+and\s+)?)+)")
ROW = re.compile(r"^\| `(\w+)` \|", re.MULTILINE)


def sections() -> list[str]:
    return [
        section for page in PAGES for section in re.split(r"^#", page.read_text(encoding="utf-8"), flags=re.MULTILINE)
    ]


def quoted() -> dict[str, set[str]]:
    """Benchmark -> the names under which it prints what the pages quote."""
    found: defaultdict[str, set[str]] = defaultdict(set)
    for section in sections():
        for command in COMMAND.finditer(section):
            found[command[1]] |= {" ".join(name.split()) for name in re.findall("`([^`]+)`", command[2])}
            found[command[1]] |= set(ROW.findall(section))
    return found


@pytest.mark.parametrize("name", BENCHMARKS)
def test_it_runs_to_its_end_and_prints_the_figures_that_pages_quote(name: str, tmp_path: Path) -> None:
    done = ran(ROOT / "benchmarks" / f"{name}.py", "--quick", "--json", "found.json", folder=tmp_path)
    assert done.returncode == 0, done.stderr[-3000:]
    assert not [figure for figure in quoted()[name] if figure not in done.stdout], done.stdout
    assert (tmp_path / "found.json").stat().st_size > 2


def test_a_page_that_names_a_benchmark_says_what_it_prints() -> None:
    for section in sections():
        commands, mentions = COMMAND.findall(section), re.findall(r"benchmarks/\w+\.py", section)
        assert len(commands) == len(mentions), f"{mentions}: `python benchmarks/NAME.py` prints `figure` and `figure`"
    assert len(quoted()) > 10
