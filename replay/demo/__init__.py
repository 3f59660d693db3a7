"""`make demo`: the whole way on shipped recordings, from logs to the cause and to the insulation of a fleet."""
