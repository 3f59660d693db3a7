"""What was computed from facts that are others by now, and the same asked again.

`stale` finds it, `redo` asks again.
"""
