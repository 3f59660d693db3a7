"""Recorded tests and everything that may differ as one vector: what it does to a run and its readings, and its fit."""
