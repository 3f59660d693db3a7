"""The thermal twin: pure numerics over arrays. No file, no clock, no print.

Rooms from the bottom up; each imports from those before it only: `arithmetic`, `motor`, `compiled`, `run`, `filters`,
`paper`, `fitting`, `differences`, `diagnosis`, `planning`, `calibration`, `insulation`. `errors` is everyone's.
"""
