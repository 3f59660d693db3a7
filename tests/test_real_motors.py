"""Recordings of a real motor that are not shipped: cut into sessions, and read by the template of its nodes."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from benchmarks.real.motors import HUST, motor_of, session_of
from benchmarks.real.recordings import recordings
from ingest.facts import facts
from ingest.facts.sessions import Override
from ingest.facts.store import Store
from ingest.intake.intake import take_in
from ingest.intake.setup import prepare
from replay.engine.files.models import for_intake
from replay.studies.characterise.calibrate import common_model

HEAD = "profile_id,t_s,u_d,u_q,i_d,i_q,motor_speed,torque,ambient,coolant,pm,stator_yoke,stator_tooth,stator_winding"


def test_profiles_are_cut_into_sessions_of_half_an_hour_which_the_template_reads(tmp_path: Path) -> None:
    data, room = tmp_path / "data", tmp_path / "room"
    for folder in (data, room):
        folder.mkdir()
    for number, hours in ((24, 2.05), (60, 0.4)):
        t = np.arange(0.0, 3600 * hours, 20.0)
        warm = 20 + 40 * (1 - np.exp(-t / 2000))
        with (data / f"profile_{number}_every40th.csv").open("w", newline="") as text:
            csv.writer(text).writerows(
                [HEAD.split(",")]
                + [[number, s, -90, 40, -100, 60, 3000, 60, 22, 20, *[w] * 4] for s, w in zip(t, warm, strict=True)]
            )
    motor = motor_of(data, room, quick=False)
    assert [session_of(log) for log in motor.logs] == [*(f"profile_24_{part}" for part in (1, 2, 3, 4)), "profile_60_1"]
    with Store.open(tmp_path / "store", create=True, write=True) as store:
        take_in(store, motor.logs, prepare(motor.logs, motor.bench, [], for_intake), Override())
        known = facts.at(store.ledger)
        sessions = [known.session(session_of(log)) for log in motor.logs]
        every = recordings(store, known, sessions, common_model(known, sessions))
    assert [set(one.readings) for one in every] == [{"winding", "teeth", "yoke", "rotor"}] * 5
    assert sum(one.test.frame.features.shape[0] * one.test.frame.step_s for one in every[:4]) > 7200, "no row is lost"
    assert motor_of(data, room, quick=True).logs == motor.logs[:3]
    with pytest.raises(SystemExit, match=r"^--seven is for the recordings id_\*\.csv, which .* does not hold"):
        motor_of(data, room, quick=False, seven=True)


def test_the_shipped_recordings_are_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    motor = motor_of(HUST, tmp_path, quick=False)
    assert [int(session_of(log)[3:]) for log in motor.logs] == [0, 1, 2, 3, 4, 6, 7, 9, 10, 12, 14]
    assert motor.law is not None
