"""Which cause the data ask for, what cannot be told apart, what stays unknown, and what naming gained.

In the order of a diagnosis: `late_clocks` finds loggers that are late, `swaps` wrong units and exchanged channels, both
before anything is fitted, and `contradictions` tests that ran `alike` and were read otherwise. `refined` fits the noise
of the channels (`reml`) and the width of each family's priors (`pooling`) to the data. `naming` goes round by round and
leaves each term out once at the end; in a round (`rounds`) every candidate is scored with all healthy differences
integrated out (`evidence`, at the `posterior_mode`), the leading ones are refitted (from where `taking_over` puts them)
and the best is taken, by evidence or, where the file's form is wrong, by sessions left out (`left_out`);
`evidence_split` says where a ln BF comes from. `findings` are what healthy differences had to do beyond usual,
`crudeness` how much of that there is, `in_words` their plain names.

`unknown` is a free heat at one node, in time or, by `free_maps`, over speed and load; `free_heats` puts it at every
node against the named causes, `patchwork` finds terms that stand only together. `kept_tests` and `gain` ask sessions
that nothing was learnt from, `faults` weighs what is wrong with the data, `onset` since when a cause acts.
`told_apart`, `next_tests` and `two_models` say what is open and which test or sensor would tell, `expressible` what
motor and bench files can hold of it.
"""
