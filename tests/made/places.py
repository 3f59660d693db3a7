"""Where the checkout has what tests read."""

from pathlib import Path

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples"
LOGS = ROOT / "tests" / "ingest" / "formats" / "files"  # a small log of every format
