"""Which files a diagnosis offers: all that replay, whether the kept sessions got better with them or not."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from replay.studies.diagnosis import offered as offers
from replay.studies.diagnosis.as_recorded import AsRecorded
from replay.studies.diagnosis.extension import Version
from twin.errors import DivergedError

PUBLISHED = "9ac1f00d"
RAN = AsRecorded({}, {})
QUESTION: Any = SimpleNamespace(model=PUBLISHED, kept=["k"], train=["t"])
CAMPAIGN: Any = SimpleNamespace(tests=["learnt from"])


def _refit(cause: str, repeated: bool = False) -> SimpleNamespace:
    return SimpleNamespace(candidate=SimpleNamespace(cause=cause, sayable=not repeated))


def _offered(
    patch: pytest.MonkeyPatch,
    *named: SimpleNamespace,
    kept: bool = True,
    runs_away: str = "",
    map_said: str | None = None,
) -> tuple[offers.Offered, list[object]]:
    """What is offered where these are named, and which tests were replayed; the model `runs_away` does so."""
    replayed: list[object] = []

    def version(_: object, __: object, fit: str, *___: object) -> Version:
        return Version(fit, None)

    def as_recorded(_: object, one: Version, sessions: object, tests: object) -> AsRecorded:
        replayed.append((sessions, tests))
        if one.motor == runs_away:
            raise DivergedError("node magnet runs away")
        return RAN

    patch.setattr(offers, "version", version)
    patch.setattr(offers, "as_recorded", as_recorded)
    naming = SimpleNamespace(accepted=named, final="extended", map_said=map_said)
    found: Any = SimpleNamespace(base="recalibrated", naming=naming, swaps=[])
    tests: Any = ["kept"] if kept else []
    return offers.offered(QUESTION, CAMPAIGN, found, "4f0c", tests), replayed


def test_what_is_named_is_always_in_the_extended_files(monkeypatch: pytest.MonkeyPatch) -> None:
    found, replayed = _offered(monkeypatch, _refit("loss.magnet.scale"))
    assert found.files == {"before": Version("recalibrated", None), "after": Version("extended", None)}
    assert found.why_none is None and list(found.runs) == ["published", "before", "after"]
    assert replayed == [(["k"], ["kept"])] * 3


def test_without_kept_sessions_too_if_those_that_were_learnt_from_replay(monkeypatch: pytest.MonkeyPatch) -> None:
    found, replayed = _offered(monkeypatch, _refit("loss.magnet.scale"), kept=False)
    assert list(found.files) == ["before", "after"]
    assert found.runs == {}, "nothing is measured on what was learnt from"
    assert replayed == [(["t"], ["learnt from"])] * 3


def test_a_heat_without_a_name_is_in_the_extended_file_where_that_can_say_it(monkeypatch: pytest.MonkeyPatch) -> None:
    found, _ = _offered(monkeypatch, map_said="loss.magnet.map")
    assert list(found.files) == ["before", "after"]
    assert list(_offered(monkeypatch)[0].files) == ["before"]


def test_what_no_file_can_say_is_in_none(monkeypatch: pytest.MonkeyPatch) -> None:
    found, _ = _offered(monkeypatch, _refit("conductance.slot.session", repeated=True))
    assert list(found.files) == ["before"] and found.why_none is None


@pytest.mark.parametrize(
    ("model", "left", "ran", "why"),
    [
        ("extended", ["before"], ["published", "before"], "in a replay node magnet runs away"),
        ("recalibrated", ["after"], ["published"], "in a replay node magnet runs away"),
        (PUBLISHED, ["before", "after"], [], None),
    ],
)
def test_a_model_that_runs_away_in_its_replay_is_not_offered(
    monkeypatch: pytest.MonkeyPatch, model: str, left: list[str], ran: list[str], why: str | None
) -> None:
    found, _ = _offered(monkeypatch, _refit("loss.magnet.scale"), runs_away=model)
    assert (list(found.files), list(found.runs), found.why_none) == (left, ran, why)
