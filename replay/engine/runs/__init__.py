"""A session replayed, sealed and cited: its key, its digest, and many sessions with one writer of facts.

`runs` is one replay: `open_loop_run` runs it, `summed_up` says it in numbers. `campaign` is many of them with one
writer of facts, on a `cluster` too. `identity` makes key and digest, `sources` the part of the key that stands for our
own code.
"""
