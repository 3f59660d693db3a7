"""The morning after: what a day's logs hold, what is wrong with them, and the same test before beside them.

`morning` is `whyhot morning`: `found_setup` looks for what explains the logs, `ending`, `sensors` and `jumps` judge a
session, `loggers` asks `clocks` by how much one logger's clock is late. `repeat` is `whyhot repeat`: `matching` pairs
what two runs drove alike, `differences` says what reads differently and what explains it, `changes` what the ledger
knows to have changed.
"""
