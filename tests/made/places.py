"""Where the checkout has what tests read."""

from pathlib import Path

from ingest.facts.bucket import ObjectPath

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples"
LOGS = ROOT / "tests" / "ingest" / "formats" / "files"  # a small log of every format


def on_disk(path: Path | ObjectPath) -> Path:
    """A path of a store that is known to have its files in its folder."""
    assert isinstance(path, Path)
    return path
