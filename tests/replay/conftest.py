"""The shipped campaign with a hidden effect, diagnosed once for all tests that ask what follows."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from made.places import EXAMPLES
from plant.hidden_effect import KEEP, LEARN
from replay.cli import main
from replay.studies.diagnosis import kept_sessions, search
from replay.studies.diagnosis.kept_sessions import Measured
from twin.fitting.fit import Fit
from twin.fitting.model import Test

EXAMPLE = EXAMPLES / "hidden_effect"
ASKED = ("diagnose", "--on", *LEARN, "--hold-out", *KEEP)


@dataclass(frozen=True)
class DiagnosedCampaign:
    """The store, its answer in JSON, and what the answer was made from: the fit without and with the cause, and the
    kept tests."""

    store: Path
    answer: Mapping[str, Any]
    base: Fit
    final: Fit
    kept: Sequence[Test]


def _no_such_number(text: str) -> float:
    raise AssertionError(f"{text} is no number of JSON")


@pytest.fixture(scope="session")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> DiagnosedCampaign:
    folder = tmp_path_factory.mktemp("diagnose")
    store = folder / "store"
    logs = [str(EXAMPLE / f"{name}.blf") for name in (*LEARN, *KEEP)]
    words = ["ingest", *logs, "--bench", str(EXAMPLE / "bench.toml"), "--dbc", str(EXAMPLE / "bench.dbc")]
    assert main([*words, "--store", str(store)]) == 0
    last: list[tuple[Fit, Fit, Sequence[Test]]] = []
    measured = kept_sessions.measured

    def watched(base: Fit, final: Fit, train: Sequence[Test], kept: Sequence[Test], named: bool) -> Measured:
        last.append((base, final, kept))
        return measured(base, final, train, kept, named)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(search, "measured", watched)
        assert main([*ASKED, "--store", str(store), "--json", str(folder / "answer.json")]) == 0
    text = (folder / "answer.json").read_text(encoding="utf-8")
    return DiagnosedCampaign(store, json.loads(text, parse_constant=_no_such_number), *last[-1])
