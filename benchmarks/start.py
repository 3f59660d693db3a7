"""What `whyhot --help` costs beyond the start of the interpreter, next to the bound that the program keeps.

    python benchmarks/start.py [--quick] [--json FILE] [--times N]

The program and an interpreter that does nothing are started by turns, `--times` times each. Of each is printed the
least processor time (ms), which others on the machine do not lengthen as they do the clock's: `interpreter_ms`,
`help_beyond_ms`, what `whyhot --help` takes more, and that as a ratio to the bound, `help_of_bound`. The exit code is 1
where the ratio is above 1.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:] = [place for place in sys.path if Path(place) != HERE]  # the files here have the names of packages
sys.path[:0] = [str(HERE.parent)]

from benchmarks import asked

BOUND_MS = 150.0
NOTHING = "pass"
HELP = "import sys; from replay.cli import main; sys.exit(main(['--help']))"


def main() -> None:
    """Print the figures."""
    chosen = asked.parser(__doc__, times=(40, 3)).parse_args()
    turns = [(processor_ms(NOTHING), processor_ms(HELP)) for _ in range(chosen.times)]
    interpreter, whole = (min(of_one) for of_one in zip(*turns, strict=True))
    found = {"interpreter_ms": interpreter, "help_beyond_ms": whole - interpreter}
    found["help_of_bound"] = found["help_beyond_ms"] / BOUND_MS
    for name, value in found.items():
        print(f"{name:15} {value:6.2f}")
    asked.keep(found, chosen.json)
    sys.exit(1 if found["help_of_bound"] > 1 else 0)


def processor_ms(code: str) -> float:
    """Processor time of an interpreter that runs `code`, with its start [ms]. Raises RuntimeError where it fails."""
    env = {**os.environ, "PYTHONPATH": str(HERE.parent)}
    process = subprocess.Popen([sys.executable, "-c", code], env=env, stdout=subprocess.DEVNULL)
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise RuntimeError(f"{code}: {process.returncode}")
    return 1e3 * (used.ru_utime + used.ru_stime)


if __name__ == "__main__":
    main()
