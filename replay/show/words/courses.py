"""The form of a specimen's course in words, the same in text and pictures."""

from __future__ import annotations

from collections.abc import Mapping

from replay.studies.ageing.assessment import Specimen

FORMS: Mapping[str, str] = {  # what R does
    "none": "no change beyond repeatability",
    "monotone": "rises steadily",
    "dip_then_rise": "falls, then rises",
    "changepoint": "changes course",
}
IN_BRIEF: Mapping[str, str] = {  # the same in a cell
    "none": "no change",
    "monotone": "rises",
    "dip_then_rise": "falls, rises",
    "changepoint": "changes",
}


def form(one: Specimen) -> str:
    """What its R does over the dose."""
    return _falling(one, FORMS[one.form])


def in_brief(one: Specimen) -> str:
    """The same in a cell, where "no change" is none that is seen."""
    return _falling(one, IN_BRIEF[one.form])


def _falling(one: Specimen, says: str) -> str:
    falls = one.form == "monotone" and (one.slope_percent_per_100h or 0.0) < 0.0
    return says.replace("rises", "falls") if falls else says
