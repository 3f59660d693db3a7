"""The same test again: two runs laid beside each other, what differs, and since when.

`matching` pairs what was driven alike, `differences` says what reads differently and what explains it, `changes` what
the ledger knows to have changed; `repeat` is `whyhot repeat`.
"""
