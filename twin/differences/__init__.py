"""What may differ, as data: what healthy motors do, and every candidate cause, with priors.

`everyday` holds what a healthy motor may do that its file does not say, each with a prior. `candidates` makes the
causes of one motor and bench from tables of laws that have a mechanism; `sizes` gives each a prior size, fixed before
any data are seen; `proposals` turns them into parameters of a `twin.fitting.model`.
"""
