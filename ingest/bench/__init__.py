"""The bench file: what each signal means and what is wrong with it; a first draft of one.

`bench_file` reads it; `channel` (read by `channel_tables`), `changes`, `corrections` and `derating` are its parts,
`laws` what each correction takes off. `resolving` brings it together with the `signals` of a log, `draft` writes one.
"""
