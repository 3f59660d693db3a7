"""What one replay gives: open loop, residuals, heat, hot spots, filter, smoother, and its files.

`open_loop` runs the motor by its inputs alone, with kernels from the `kernel_cache`, and `run` is what comes of it;
`compared` puts each sensor and meter beside it, `residuals` says how wrong that is and where, also without what the
bench file corrects, `heat_account` where the heat went, `hot_spots` what was hottest and `hot_spot_bands` how sure
that is. `filtered` runs filter and smoother beside it for what `asked_unknowns` were asked for, with what
`heat_readings` make of meters; nothing of that goes back into the open loop. `summary` holds all this in numbers,
`as_json` writes and reads it. `artefacts` are the files of a run, `sealed` reads them back.
"""
