"""A motor's numbers from tests: the fit, what it teaches, how sure it is."""
