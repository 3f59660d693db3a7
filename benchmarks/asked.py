"""How a benchmark is asked: the same words for all of them.

Every file here but this one and `shared.py` is a benchmark, and runs by itself: `python benchmarks/NAME.py`. With
`--quick` the same code runs at small sizes in seconds, so that the test suite can run all of them; its figures say
nothing.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path


def parser(doc: str | None, **sizes: tuple[int, int]) -> argparse.ArgumentParser:
    """The command line of a benchmark with this docstring: `--quick`, `--json FILE`, and an option for each of `sizes`,
    which says how large it is and how large with `--quick`. A benchmark adds what it alone has."""
    line = argparse.ArgumentParser(
        description=doc, formatter_class=argparse.RawDescriptionHelpFormatter, allow_abbrev=False
    )
    quick = "--quick" in sys.argv[1:]
    for name, (usual, small) in sizes.items():
        default = small if quick else usual
        line.add_argument(f"--{name}", metavar="N", type=int, default=default, help=f"{usual}; {small} with --quick")
    line.add_argument("--quick", action="store_true", help="the same code at sizes that take seconds")
    line.add_argument("--json", metavar="FILE", type=Path, help="write all numbers here")
    return line


def keep(numbers: object, file: Path | None) -> None:
    """What `--json` asks for."""
    if file:
        file.write_text(json.dumps(numbers, indent=1) + "\n", encoding="utf-8")
