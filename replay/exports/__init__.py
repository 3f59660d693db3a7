"""Sessions out again: their samples as a file of another program, read a part at a time."""
