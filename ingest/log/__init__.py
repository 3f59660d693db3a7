"""One log on its way from bytes to samples: read, recorded, decoded, every record accounted for.

`reading` opens a log in a child process, `recording` writes it as MCAP. `decode` makes samples: `databases` (read from
`database_files`; where they differ `meant` tells which) and `bits` turn `frames` into signals, but numbers whose
`value_names` say that there is none, those of `j1939` by `parameter_groups` and `transport`; `plan` says which signal
becomes which column, `held` serves derived channels across groups (`spill` keeps what waits), `specimens` parts the
rows of many, `balance` accounts for every record; `samples` are the Parquet files. `clock` judges `stamps`, `unread`
says what was not read as numbers, or may be read otherwise. `findings` are what is to be looked at. `ahead` gives both
ways a second core, `arrow` lends arrays.
"""
