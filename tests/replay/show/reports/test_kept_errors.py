"""Errors on kept sessions, as a chain of stages."""

from __future__ import annotations

from replay.show.reports.kept_errors import chain


def test_a_small_error_is_never_said_as_nought() -> None:
    assert chain({"a": 1.44, "b": 0.034, "c": 0.0004}, ["a", "b", "c", "d"]) == "1.4 -> 0.03 -> 0.0004 -> – K"
