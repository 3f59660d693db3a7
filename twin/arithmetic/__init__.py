"""Numbers side by side in vector registers, and powers with the same bits on every machine.

`vectors` makes a text that is written for one number serve several runs side by side, `interleaving` lays arrays out
for that and back; `lanes` over `lane_code` is what the filters' matrices are computed with. `powers` are the same on
every machine, `hats` what piecewise linear functions are made of.
"""
