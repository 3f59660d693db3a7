"""Errors that are compared, told so that a change is seen."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from replay.show.reports import review_report
from replay.show.reports.kept_errors import chain
from replay.show.words.words import became
from replay.studies.diagnosis.review import ReviewedKind


def test_a_small_error_is_never_said_as_nought() -> None:
    assert chain({"a": 1.44, "b": 0.034, "c": 0.0004}, ["a", "b", "c", "d"]) == "1.4 -> 0.03 -> 0.0004 -> – K"


@pytest.mark.parametrize(
    ("errors_K", "told"),
    [
        ([8.13, 0.74], "8.1 -> 0.7"),
        ([0.71, 0.69], "0.71 -> 0.69"),
        ([0.042, 0.034], "0.04 -> 0.03"),
        ([7.1, 0.402, 0.401], "7.1 -> 0.4 = 0.4"),
        ([0.0, 0.0], "0 = 0"),
        ([None, None], "– -> –"),
        ([], ""),
    ],
)
def test_what_would_be_the_same_figure_has_more_digits_or_is_said_to_be_equal(
    errors_K: list[float | None], told: str
) -> None:
    assert became(errors_K) == told


def test_what_is_to_be_signed_says_a_small_change_too() -> None:
    kind = ReviewedKind(kind="wltp", kept=True, node="magnet", sessions=2, before_K=0.042, after_K=0.034)
    change: Any = SimpleNamespace(replaced=(), causes=("loss.magnet.scale",), by_kind=lambda: [kind])
    assert review_report.answer(change).endswith(": magnet 0.04 -> 0.03 K in wltp (kept sessions).")
