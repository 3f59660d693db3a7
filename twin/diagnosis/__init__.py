"""Which cause the data ask for, what cannot be told apart, what stays unknown, and what naming gained.

In the order of a diagnosis: `swaps` finds wrong units and exchanged channels before anything is fitted. `refined` fits
the noise of the channels (`reml`) and the width of each family's priors (`pooling`) to the data. `naming` scores every
candidate with all healthy differences integrated out (`evidence`, at the `posterior_mode`), refits the leading ones
(from where `taking_over` puts them), takes the best, five at most, and leaves each out once; `evidence_split` says
where a ln BF comes from. `findings` are what healthy differences had to do beyond usual, `in_words` their plain names.

`unknown` is a heat of any course at one node, `free_heats` puts it at every node against the named causes, `patchwork`
finds terms that stand only together. `kept_tests` and `gain` ask sessions that nothing was learnt from, `faults` weighs
what is wrong with the data. `told_apart` and `next_tests` say what is open and which test would tell, `expressible`
what motor and bench files can hold of it.
"""
