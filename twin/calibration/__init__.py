"""A motor's numbers from tests: the fit, what it teaches, how sure it is.

`calibrate` is the fit, `united` the same for several rigs at once, `learned` the motor that comes out of it. `outliers`
sets readings aside, `profile` and `uncertainty` say how sure the numbers and a run are, `influence` and `point_choice`
which tests teach most.
"""
