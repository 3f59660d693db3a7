"""What the viewer shows of a session, and how its lines are called and coloured: the colour says whose line it is, the
panel which node it is about."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ingest.bench.resolving import ResolvedChannel
from ingest.catalogue.channels import ChannelData
from ingest.errors import not_installed
from ingest.facts.events import SessionRecorded
from ingest.texts.units import as_written
from replay.engine.results.run import Observed, Run
from replay.errors import ViewerError
from replay.show.plots.compare import MODELS, as_recorded
from replay.show.words import words
from replay.show.words.findings import MOVED_K
from replay.show.words.palette import SERIES
from twin.motor.network import Network

APPLICATION = "whyhot"
TIMELINES = ("since_start", "time")  # without and with absolute time
MISSING = not_installed("the rerun viewer")
MEASURED, CORRECTED, GUIDE = "#98a2b3", "#d8cc3c", "#6b7280"  # readable on dark and on light ground
ESTIMATED, SMOOTHED = SERIES["purple"][1], SERIES["orange"][1]
COLOUR = {"published": SERIES["vermillion"][1], "recalibrated": SERIES["blue"][1], "extended": SERIES["green"][1]}
LAYER = {"published": "open_loop", "recalibrated": "open_loop", "extended": "extended"}  # first part of a path


@dataclass(frozen=True)
class SessionSeen:
    """A session with its replays. `runs`: key of MODELS -> run, in the order of MODELS ("published" for the only one
    where no diagnosis made others); `network`: of the last of them; `says`: the answer of a diagnosis (Markdown);
    `missing`: which of its models were not replayed; `corrected`: what the bench file took off its readings and times;
    "" for none."""

    session: SessionRecorded
    channels: Sequence[ChannelData]
    runs: Mapping[str, Run] = field(default_factory=dict)
    network: Network | None = None
    says: str = ""
    missing: str = ""
    corrected: str = ""

    @property
    def first(self) -> Run | None:
        """The run whose readings are those as recorded; None where the session was not replayed."""
        return next(iter(self.runs.values()), None)

    @property
    def last(self) -> tuple[str, Run] | None:
        """The best model's role and run."""
        return list(self.runs.items())[-1] if self.runs else None

    @property
    def observed(self) -> list[str]:
        """Nodes with a channel: where the first model is furthest off at first, without a replay as recorded."""
        if self.first is None:
            specs = [c.spec for c in self.channels if c.spec.quantity == "temperature" and c.spec.role == "observed"]
            return list(dict.fromkeys(spec.node or spec.name for spec in specs))
        off: dict[str, float] = {}
        for one in self.first.observed:
            error = float(np.abs(one.residual[one.usable]).mean()) if one.usable.any() else 0.0
            off[one.node] = max(off.get(one.node, 0.0), error)
        return sorted(off, key=lambda node: -off[node])

    @property
    def others(self) -> list[str]:
        """Nodes of the first model without a channel."""
        return [node for node in self.first.nodes if node not in self.observed] if self.first else []

    @property
    def key(self) -> dict[str, str]:
        """What is drawn -> its colour."""
        models = {self.label(role): COLOUR[role] for role in self.runs}
        corrected = any(self.moved(o) for run in self.runs.values() for o in run.observed)
        return {"measured": MEASURED, **models} | ({"measured, as corrected": CORRECTED} if corrected else {})

    def recorded(self, observed: Observed) -> Observed:
        """A model's channel with the reading as recorded."""
        first = self.first.observed if self.first else ()
        return next((as_recorded(one, observed) for one in first if one.channel == observed.channel), observed)

    def moved(self, observed: Observed) -> bool:
        """Whether the model's bench file corrects the reading by enough to see."""
        by = np.abs(observed.measured - self.recorded(observed).measured)[observed.usable]
        return by.size > 0 and float(by.mean()) >= MOVED_K

    def label(self, role: str) -> str:
        """What a reader calls the model of `role`, with the level that it started from where others have another."""
        called = MODELS[role].label if len(self.runs) > 1 else "model"
        alike = len({run.level for run in self.runs.values()}) == 1
        return called if alike else f"{called} ({self.runs[role].level})"


def rgba(colour: str) -> int:
    """ "#rrggbb" -> 0xRRGGBBff."""
    return int(colour[1:] + "ff", 16)


def unit(spec: ResolvedChannel) -> str:
    """The unit of a channel's stored values, as people write it."""
    return as_written(spec.stored_unit or "")


def sdk() -> Any:
    """The rerun SDK. Raises ViewerError where it is not installed."""
    try:
        import rerun
    except ImportError as error:
        raise ViewerError(MISSING) from error
    return rerun


def path(*parts: str) -> str:
    """An entity path; whatever a part holds stays one part."""
    rr = sdk()
    return "/".join(rr.escape_entity_path_part(part) for part in parts)


def of_model(role: str, run: Run) -> tuple[str, str]:
    """The first two parts of the paths of a model's temperatures."""
    return LAYER[role], words.short(run.model)
