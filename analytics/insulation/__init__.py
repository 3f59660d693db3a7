"""Numerics of insulation ageing over arrays: doses, resistances, their course, life. No file, clock or print.

Rooms from the bottom up; each imports from those before it only: `dose`, `checks`, `courses`, `fleet`, `life`.
`campaign` puts them together.
"""
