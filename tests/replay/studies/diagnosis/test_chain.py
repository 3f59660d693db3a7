"""Files of a step of the chain: none where these cannot say its terms, or where a replay with them runs away."""

from __future__ import annotations

from typing import Any, cast

import pytest

from ingest.errors import IngestError
from replay.studies.diagnosis import chain
from replay.studies.diagnosis.extension import Version
from twin.errors import DivergedError

MADE = Version("9ac1f00d", None)


@pytest.mark.parametrize(
    ("of_files", "of_replay", "left"),
    [
        (None, None, MADE),
        (IngestError("bench.toml: no place"), None, None),
        (None, DivergedError("temperatures run away"), None),
    ],
)
@pytest.mark.parametrize("kept", [True, False])
def test_a_step_offers_what_can_be_written_and_replayed(
    of_files: Exception | None,
    of_replay: Exception | None,
    left: Version | None,
    kept: bool,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    ran = object()

    def made(*_: object) -> Version:
        if of_files:
            raise of_files
        return MADE

    def replayed(question: Any, files: Version, sessions: object, tests: object) -> object:
        assert (sessions, tests) == (("kept", [1]) if kept else ("learnt", [2]))
        if of_replay:
            raise of_replay
        return ran

    monkeypatch.setattr(chain, "version", made)
    monkeypatch.setattr(chain, "as_recorded", replayed)

    class Asked:
        kept, train, tests = "kept", "learnt", [2]

    build = chain._Build(cast(Any, Asked), cast(Any, Asked), cast(Any, [1] if kept else []), {})
    files, runs = build.files(cast(Any, None), (), (), "d")
    assert files == left
    assert runs is (ran if left and kept else None)
