"""The input frame: the one narrow door from a session's channels into the twin.

`frame` averages every product of features over each step from held signals (`inputs`), as the mean of I^2 is not the
square of a mean; `observations` are what sensors and meters measured, `meters` say what power, heat, resistance and
flux are of. `frame_of` is the one way to a session's frame.
"""
