"""What heat has done to the insulation of every specimen: its history, its checks, and the answer.

`assess` asks: `history` puts a specimen's sessions in order, `dc_checks` and `configured_checks` evaluate its checks,
`discharge` and `stress` weigh other stresses, `lives` finds lives by a criterion. `assessment` is the dataclass and its
one JSON, `tables` the rows for SQL, `whole` a fleet in one picture.
"""
