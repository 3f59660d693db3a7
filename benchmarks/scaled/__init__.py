"""The parts of `benchmarks/scale.py` that are no campaign."""
