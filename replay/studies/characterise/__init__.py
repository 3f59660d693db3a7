"""A motor's numbers from sessions: the protocol, what sensors are worth, what the motor bears.

`calibrate`, `protocol`, `sensors` and `envelope` are the verbs of these names; `bands` says how far filters may be off.
"""
