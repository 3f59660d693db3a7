"""Logs become facts: readers, recordings, decoded samples, the ledger, sessions and the catalogue.

Rooms from the bottom up; each imports from those before it only: `units`, `texts`, `formats`, `bench`, `facts`,
`log`, `catalogue`, `intake`, `morning`. `errors` is everyone's.
"""
