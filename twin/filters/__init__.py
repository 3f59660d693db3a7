"""Temperatures and unknowns estimated while readings come in: Kalman filters and a smoother.

`ekf`, `ukf` and `smoother` are the doors; all take `inputs` and `unknowns`. `planning` lays out a compiled step as a
`plan`; `step` goes through it, `matrix` over `pivots` eliminates its network, `readings` takes the measured values in.
`by_filterpy` is the same filter by another library, to compare with. docs/filters.md says which to take.
"""
