"""What else could say a real motor's temperatures, and how each is judged.

`recordings` reads the sessions, `boosted` and `echo_state` are regressions, `left_out` learns them from all recordings
but one with settings chosen on those learnt from, `errors` holds any of them against readings as recorded, inside and
outside the trained points, `virtual` reads the stator's sensors alone.
"""
