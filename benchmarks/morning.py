"""What `whyhot morning` takes for a day of CAN logs, next to what others take only to read them.

    python benchmarks/morning.py [--quick] [--json FILE] [--logs N] [--seconds N]

A day is `--logs` BLF files of `--seconds` each, one behind the other with 10 minutes between: a simulated motor of
three temperatures, 10 frames a second of speed, torque and current and one of temperatures, with bench file and
database beside them. The command runs as anyone starts it, without a store, and must give a session a log with every
frame accounted for. Printed are `seconds` on the clock and `processor_s`, children included, and that as a ratio to
what python-can and cantools take in the same run to read the same logs frame by frame into Parquet, and judge nothing:
`of_reading`. The exit code is 1 where a day of usual size takes more than a minute of processor time.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
sys.path[:] = [place for place in sys.path if Path(place) != HERE]  # the files here have the names of packages
sys.path[:0] = [str(HERE.parent / "tests"), str(HERE.parent)]

from benchmarks import asked
from benchmarks.ingest import clocks, frame_by_frame
from made import can_bench

PAUSE_S = 600
BOUND_S = 60.0
MORNING = "import sys; from replay.cli import main; sys.exit(main(sys.argv[1:]))"


def main() -> None:
    """Print the figures."""
    chosen = asked.parser(__doc__, logs=(18, 2), seconds=(4800, 300)).parse_args()
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "night"
        folder.mkdir()
        can_bench.write_files(folder)
        logs = [folder / f"run{k:02}.blf" for k in range(chosen.logs)]
        starts = can_bench.START + np.arange(chosen.logs) * float(chosen.seconds + PAUSE_S)
        each = enumerate(zip(logs, starts, strict=True))
        frames = sum(can_bench.write_log(log, chosen.seconds, k, start) for k, (log, start) in each)
        wall, processor = spent(lambda: morning(folder, len(logs), frames))
        _, reading = spent(lambda: read(logs, folder / "bench.dbc", Path(place)))
    found = {"logs": len(logs), "frames": frames, "seconds": wall, "processor_s": processor}
    found["of_reading"] = processor / reading
    for name, value in found.items():
        print(f"{name:12} {value:12,.2f}")
    asked.keep(found, chosen.json)
    sys.exit(1 if not chosen.quick and processor > BOUND_S else 0)


def spent(work: Callable[[], object]) -> tuple[float, float]:
    """What `work` takes: on the clock, and of processors with those of its children [s]."""
    begun = clocks()
    work()
    wall, processor = (clocks() - begun).tolist()
    return wall, processor


def morning(folder: Path, logs: int, frames: int) -> None:
    """`whyhot morning` over a folder. Raises SystemExit where it does not tell of every log and frame."""
    command = [sys.executable, "-c", MORNING, "morning", str(folder), "--json", "--store", str(folder / "none")]
    done = subprocess.run(command, cwd=HERE.parent, capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(f"whyhot morning ended with {done.returncode}: {done.stderr[-1000:]}")
    said = json.loads(done.stdout)
    decoded = sum(one["balance"]["decoded"] for one in said["files"])
    if (len(said["sessions"]), decoded) != (logs, frames):
        sys.exit(f"{len(said['sessions'])} sessions of {logs} logs, {decoded} frames decoded of {frames}")


def read(logs: Sequence[Path], dbc: Path, place: Path) -> None:
    """The logs frame by frame into Parquet."""
    for log in logs:
        own = place / log.stem
        own.mkdir()
        frame_by_frame(log, dbc, own)


if __name__ == "__main__":
    main()
