"""A session replayed, sealed and cited: its key, its digest, and many sessions with one writer of facts.

`runs` is one replay, `campaign` many with one writer of facts. `identity` makes key and digest, `sources` the part of
the key that stands for our own code.
"""
