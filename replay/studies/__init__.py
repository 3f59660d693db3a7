"""Studies: one function each over stored sessions, returning a dataclass.

Rooms from the bottom up; each imports from those before it only: `sessions`, `motors`, `characterise`, `diagnosis`,
`planning`, `since`, `ageing`, `again`, `lineage`.
"""
