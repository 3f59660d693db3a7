"""Stored sessions as fits take them, and what surrounds a fit.

`recorded` turns a session into a test of `twin.fitting.recorded`, `history` counts what its specimen had behind it,
`fitting` surrounds every fit.
"""
