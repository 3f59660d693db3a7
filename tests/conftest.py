"""Property tests: the same examples on every machine, and no deadline on a shared one. And which tests come first."""

from pathlib import Path

import pytest
from hypothesis import settings

settings.register_profile("house", deadline=None, derandomize=True)
settings.load_profile("house")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The files beside this one, which run the whole program, come first: a long one that came last would run alone."""
    items.sort(key=lambda item: item.path.parent != Path(__file__).parent)
