"""Numerics of insulation ageing over arrays: doses, resistances, their course, life. No file, clock or print."""
