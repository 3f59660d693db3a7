"""One motor, given inputs: its temperatures and losses, the derivatives of a run, the load that it bears.

`simulate` is one run, `side_by_side` many; `gradients`, `block_columns` and `sparse_march` say what each parameter does
to it. `losses` closes the heat account, `initial` says where a run begins, `describe` is a network in numbers.
`envelope`, `operating_map`, `derating` and `reduction` ask more of a motor than one run.
"""
