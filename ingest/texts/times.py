"""Times as people read them."""

from __future__ import annotations


def clock(seconds: float) -> str:
    """Seconds since the start of a session as h:mm:ss."""
    whole = round(seconds)
    return f"{whole // 3600}:{whole // 60 % 60:02}:{whole % 60:02}"
