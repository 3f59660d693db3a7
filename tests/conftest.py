"""Property tests: the same examples on every machine, and no deadline on a shared one."""

from hypothesis import settings

settings.register_profile("house", deadline=None, derandomize=True)
settings.load_profile("house")
