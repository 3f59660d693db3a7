"""The motor as the specimen of a session has it: what it went through before, and what is left of its numbers.

`heat_history` counts a specimen's earlier hours by temperature, `aged` makes its network of that and of what checks
left, `maps_left` says where a session leaves a motor's tables.
"""
