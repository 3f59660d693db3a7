"""What `benchmarks/torture.py` does to stores, a file a kind of harm.

`outcome` is what an attack gives, `children` how work runs and dies apart, `subjects` what is attacked. Attacks:
`kills` (T1, T2, T18), `unsynced` (T3), `faults` (T4 to T6), `flips` (T7, T8), `tampering` (T9), `planted` (T10), `logs`
(T11, T12, T20), `sequences` (T13), `together` (T14, T15), `again` (T16, T17, T22), `strangers` (T19, T21, T24), `leaks`
(T23).
"""
