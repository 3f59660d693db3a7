"""The law of deterioration in a motor file: read, refused, and written by a program."""

from __future__ import annotations

import json
import re
from importlib.resources import files

import pytest

from plant.bare_stator_motor import motor_toml
from replay.engine.files import motor_file
from replay.engine.files.motor_file import read_motor
from replay.engine.files.motor_text import with_law, written
from replay.errors import MotorFileError
from twin.motor.ageing_law import Ageing, AgeingTerm, ageing_places
from twin.motor.configured import configured
from twin.motor.network import Network

AGEING = "{above_degC = 180.0, percent_per_100h = -3.1, sd = 0.8, from_h = 40}"
MOTOR = f"""\
schema = "whyhot.motor/1"
name = "aged"
[[node]]
name = "winding"
capacity = 900.0
[[node]]
name = "teeth"
capacity = 900.0
[[boundary]]
name = "air"
[[link]]
between = ["winding", "teeth"]
terms = [{{coefficient = 12.0, ageing = {AGEING}}}, {{coefficient = 1.0}}]
[[link]]
between = ["teeth", "air"]
terms = [{{coefficient = 5.0}}]
[[source]]
node = "winding"
terms = [{{coefficient = 90.0, copper = true, ageing = {{above_degC = 155, percent_per_100h = 2}}}}]
"""


def read(text: str = MOTOR) -> Network:
    return read_motor(text.encode(), "motor.toml")


def test_a_term_of_a_link_or_source_may_age() -> None:
    slot, source = ageing_places(read())
    assert (slot.place, slot.insulation, slot.ageing) == ("winding-teeth", True, Ageing(180.0, -3.1, 0.8, 40.0))
    assert (source.place, source.insulation, source.ageing) == ("winding", False, Ageing(155.0, 2.0, 1.0, 0.0))


REFUSED = {
    "all gone": ("percent_per_100h = -3.1", "percent_per_100h = -100", r"percent_per_100h must be a number above -100"),
    "no rate": ("percent_per_100h = -3.1, ", "", r"percent_per_100h is missing"),
    "no temperature": ("above_degC = 180.0, ", "", r"above_degC is missing"),
    "sure": ("sd = 0.8", "sd = 0", r"sd must be a number above 0"),
    "before new": ("from_h = 40", "from_h = -1", r"from_h must be a number of 0 or more"),
    "key": ("from_h = 40", "form_h = 40", r'unknown key "form_h"\. Nearest: from_h'),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_wrong_law_is_refused_by_line(case: str) -> None:
    old, new, says = REFUSED[case]
    assert old in MOTOR
    with pytest.raises(MotorFileError, match=rf"^motor\.toml:13: .*{says}"):
        read(MOTOR.replace(old, new, 1))


def test_the_schema_has_the_default_that_the_reader_has() -> None:
    schema = json.loads((files("replay") / "schema" / "motor.schema.json").read_text(encoding="utf-8"))
    assert schema["$defs"]["ageing"]["properties"]["sd"]["default"] == motor_file.AGEING_SD


def test_a_law_changes_where_it_stands() -> None:
    changed = read(MOTOR.replace("-3.1", "-2.5").replace("from_h = 40", "from_h = 0"))
    text = written(MOTOR.encode(), "motor.toml", changed, "learnt").decode()
    assert text.replace("# learnt\n", "") == MOTOR.replace("-3.1", "-2.5").replace("from_h = 40", "from_h = 0")


def test_a_law_is_written_to_the_insulation_of_every_rig() -> None:
    text = motor_toml()
    found = with_law(text, read(text), -3.1, 0.8, 180.0, 40.0)
    law = Ageing(180.0, -3.1, 0.8, 40.0)
    for rig in (None, "stator_in_air"):
        assert {place.place: place.ageing for place in ageing_places(configured(read(found), rig))} == {
            f"{copper}-{iron}": law for copper, iron in (("winding", "teeth"), ("winding", "yoke"))
        }
    comment = "# insulation: -3.1 % per 100 h above 180 degC from 40 h on, learnt from checks\n"
    assert comment in found
    assert re.sub(r", ageing = \{[^}]*\}", "", found.replace(comment, "")) == text


def test_a_law_takes_the_place_of_the_one_before() -> None:
    found = with_law(MOTOR, read(), -4.0, 0.5, 180.0)
    slot, source = ageing_places(read(found))
    assert slot.ageing == Ageing(180.0, -4.0, 0.5, 0.0)
    assert source.ageing.percent_per_100h == 2.0
    assert all(isinstance(term, AgeingTerm) for term in read(found).links[0].terms)


def test_a_motor_without_insulation_gets_no_law() -> None:
    text = MOTOR.replace('"teeth"', '"housing"')
    with pytest.raises(MotorFileError, match=r'^motor aged: no link leads from a node of region "copper"'):
        with_law(text, read(text), -3.0, 1.0, 180.0)
