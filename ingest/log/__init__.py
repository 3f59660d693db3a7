"""One log on its way from bytes to samples: read, recorded, decoded, every record accounted for.

`reading` opens a log in a child process, `recording` writes it as MCAP. `decode` makes samples: `databases` and `bits`
turn frames into signals, `plan` says which signal becomes which column, `held` serves derived channels across groups,
`balance` accounts for every record; `samples` are the Parquet files; `ahead` gives both ways a second core.
"""
