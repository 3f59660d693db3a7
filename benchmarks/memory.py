"""How much memory `ingest` and `show` of a long log take, next to the bound that the program keeps.

    python benchmarks/memory.py [--quick] [--json FILE] [--mb N]

A BLF of one message at 4,000 frames a second, of as many megabytes as `--mb` says (2000 for one of 2 GB), with a bench
file for its four signals. Each verb is a command of its own. Of it is printed what all its processes held at once at
most (`all`: what they share is counted in each), and the largest of them (`largest`), as the system counts it: Linux
only. What is held is looked at 50 times a second. The exit code is 1 where one is above the bound.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
sys.path[:] = [place for place in sys.path if Path(place) != HERE]  # the files here have the names of packages
sys.path[:0] = [str(HERE.parent / "tests"), str(HERE.parent)]

from benchmarks import asked
from made.blf import write_blf

BOUND_MIB = 1024
MIB = 1 << 20
PROBE = 20_000  # frames that tell how many a megabyte holds
EVERY_S = 0.02
CODE = "import sys; from replay.cli import main; sys.exit(main())"
DATABASE = 'VERSION ""\nBU_: BENCH\nBO_ 256 Words: 8 BENCH\n' + "".join(
    f' SG_ w{k} : {16 * k}|16@1+ (0.1,-40) [0|0] "degC" BENCH\n' for k in range(4)
)
BENCH = 'schema = "whyhot.bench/1"\n' + "".join(
    f'[[channel]]\nsignal = "Words.w{k}"\nquantity = "temperature"\nunit = "degC"\n' for k in range(4)
)


def main() -> None:
    """Print the table."""
    chosen = asked.parser(__doc__, mb=(200, 2)).parse_args()
    with tempfile.TemporaryDirectory(prefix="memory") as place:
        folder = Path(place)
        frames = write_setup(folder, chosen.mb * 1_000_000)
        size = (folder / "log.blf").stat().st_size
        print(f"log.blf: {size / 1e6:,.0f} MB, {frames:,} frames; bound {BOUND_MIB:,} MiB")
        print(f"{'':8} {'all MiB':>8} {'largest MiB':>12} {'of bound':>9} {'s':>6}")
        ingest = ("ingest", "log.blf", "--bench", "bench.toml", "--dbc", "bench.dbc")
        found = [measured(folder, *words) for words in (ingest, ("show", "log"))]
    asked.keep({"bytes": size, "frames": frames, "bound_MiB": BOUND_MIB, "verbs": found}, chosen.json)
    sys.exit(1 if any(one["all_MiB"] > BOUND_MIB for one in found) else 0)


def write_setup(folder: Path, size: int) -> int:
    """The log of about `size` bytes, bench file and database; how many frames it has."""
    write_blf(folder / "log.blf", PROBE)
    frames = PROBE * size // (folder / "log.blf").stat().st_size
    write_blf(folder / "log.blf", frames)
    (folder / "bench.toml").write_text(BENCH, encoding="utf-8")
    (folder / "bench.dbc").write_text(DATABASE, encoding="utf-8")
    return frames


def measured(folder: Path, *words: str) -> dict[str, Any]:
    """One command, watched. Raises RuntimeError where it fails."""
    env = {**os.environ, "PYTHONPATH": str(HERE.parent), "WHYHOT_STORE": "store"}
    began, most, said = time.monotonic(), 0, folder / "said.txt"
    with said.open("w") as output:
        process = subprocess.Popen(
            [sys.executable, "-c", CODE, *words], cwd=folder, env=env, stdout=output, stderr=output
        )
        while not (ended := os.wait4(process.pid, os.WNOHANG))[0]:
            most = max(most, sum(map(_held, _family(process.pid))))
            time.sleep(EVERY_S)
    process.returncode = os.waitstatus_to_exitcode(ended[1])
    if process.returncode:
        raise RuntimeError(f"{words[0]}: {process.returncode}: {said.read_text()[-2000:]}")
    seconds, largest = time.monotonic() - began, ended[2].ru_maxrss * 1024
    found = {"verb": words[0], "all_MiB": max(most, largest) // MIB, "largest_MiB": largest // MIB, "seconds": seconds}
    share = 100 * max(most, largest) / MIB / BOUND_MIB
    print(f"{words[0]:8} {found['all_MiB']:8,} {found['largest_MiB']:12,} {share:7.0f} % {seconds:6.1f}", flush=True)
    return found


def _family(pid: int) -> list[int]:
    """A process and those that it started."""
    try:
        started = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    except OSError:
        return []
    return [pid, *(one for child in started for one in _family(int(child)))]


def _held(pid: int) -> int:
    """Bytes of memory of a process, none where it has ended."""
    try:
        return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * resource.getpagesize()
    except OSError:
        return 0


if __name__ == "__main__":
    main()
