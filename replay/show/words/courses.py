"""The form of a specimen's course in words, the same in text and pictures."""

from __future__ import annotations

from collections.abc import Mapping

from replay.studies.ageing.assessment import Specimen

FORMS: Mapping[str, str] = {
    "none": "no change beyond repeatability",
    "monotone": "rising steadily",
    "dip_then_rise": "falling first, then rising",
    "changepoint": "changing course",
}


def form(one: Specimen) -> str:
    """What its R does over the dose."""
    falls = one.form == "monotone" and (one.slope_percent_per_100h or 0.0) < 0.0
    return "falling steadily" if falls else FORMS[one.form]
