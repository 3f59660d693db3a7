"""Studies: one function each over stored sessions, returning a dataclass."""
