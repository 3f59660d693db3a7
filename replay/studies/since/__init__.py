"""Since when: other sessions with the signature of a known cause, and where a channel's residual began.

`acting` reads the sessions of one specimen and says in which of them a cause may act; `seen` asks every motor of the
store for the cause of a diagnosis, `bisect` one motor for whatever a channel began to read, and the motor files before
its own.
"""
