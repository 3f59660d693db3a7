"""whyhot: why is the motor hotter than the model says?

The parts are the packages `ingest`, `twin`, `analytics` and `replay`; this one is the name to import in a notebook.
"""

from importlib.util import find_spec
from pathlib import Path

PACKAGES = ("ingest", "twin", "analytics", "replay")

for _name in PACKAGES:
    _spec = find_spec(_name)
    if _spec and _spec.origin and Path(_spec.origin).parents[1] != Path(__file__).parents[1]:
        raise ImportError(
            f"{_spec.origin} hides whyhot's package '{_name}': rename it, or start Python in another folder"
        )

__version__ = "0.1.0"
