"""The thermal twin: pure numerics over arrays. No file, no clock, no print."""
