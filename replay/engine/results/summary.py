"""What a run found, in numbers: one dataclass, and its JSON, which the fact of a run holds and `replay --json` prints.

Defaults are what runs have that were sealed before there was such an entry.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from ingest.bench.derating import DeratingRule
from replay.engine.results.as_json import IF_SAID, from_json, to_json
from replay.engine.specimen.aged import Aged
from twin.run.derating import Derated
from twin.run.losses import HeatBalance


@dataclass(frozen=True, kw_only=True)
class IntegratorDistance:
    """How far a run by integrator `name` is from one by the default, `against`: `error_K` at `node` and `at_s`."""

    name: str
    error_K: float
    node: str
    at_s: float
    against: str


@dataclass(frozen=True, kw_only=True)
class ChannelErrors:
    """A thermometer beside the model over its usable steps, residual = measured - modelled [K]. `node`: what it
    follows; `max_K`: the largest size of the residual, at `max_at_s` from start; `white_K`, `bias_sd_K`: noise of a
    mean and constant error that the sensor may have, `floor_K` both together; `samples`, `masked`: usable steps and
    others; `where`: range of each quantity, by name with unit, in which the error is largest; `measured_max_degC`, at
    `measured_max_at_s` from start: the highest reading, None in runs that were sealed without it. Where the bench file
    corrects the reading, all that is of the corrected one: `mae_recorded_K` is the mean error against the reading as
    recorded, `reading_moved_K` corrected minus recorded in the mean; else both are None."""

    channel: str
    node: str
    mae_K: float
    max_K: float
    bias_K: float
    white_K: float
    bias_sd_K: float
    floor_K: float
    samples: int
    masked: int
    max_at_s: float
    where: dict[str, list[float]]
    measured_max_degC: float | None = None
    measured_max_at_s: float | None = None
    mae_recorded_K: float | None = field(default=None, metadata=IF_SAID)
    reading_moved_K: float | None = field(default=None, metadata=IF_SAID)

    @property
    def within_floor(self) -> bool:
        """The mean error is not larger than the channel's own uncertainty."""
        return self.mae_K <= self.floor_K


@dataclass(frozen=True, kw_only=True)
class MeterErrors:
    """A meter that is no thermometer beside the model, as `ChannelErrors`, numbers in `unit`. `place`: what it is
    about; `mean` of what it measured; `gain_sd`: of the share by which it may read too much."""

    channel: str
    quantity: str
    place: str
    unit: str
    mae: float
    max: float
    bias: float
    mean: float
    white: float
    bias_sd: float
    gain_sd: float
    floor: float
    samples: int
    masked: int
    max_at_s: float
    where: dict[str, list[float]]

    @property
    def within_floor(self) -> bool:
        """The mean error is not larger than what the meter itself leaves open."""
        return self.mae <= self.floor


@dataclass(frozen=True, kw_only=True)
class Efficiency:
    """Energy out over energy in, motor and generator alike. `modelled`: electrical power is mechanical power and
    losses; `measured`: as recorded, None without it; `mechanical_J`: energy out of the shaft."""

    modelled: float
    measured: float | None
    mechanical_J: float


@dataclass(frozen=True, kw_only=True)
class LimitPassed:
    """How long a node that has a limit was above it, and how hot it became."""

    limit_degC: float
    above_s: float
    max_degC: float


@dataclass(frozen=True, kw_only=True)
class SpotProfile:
    """Where along equal slices it was hottest: `max_degC`, `slices` from the hottest one's middle `towards` a node."""

    max_degC: float
    towards: str
    slices: float


@dataclass(frozen=True, kw_only=True)
class HotSpot:
    """The hottest node of a winding or magnet: which, how hot and when, its limit and what was left of it (None where
    the motor file says none); `profile` where that node is a slice between two equal ones."""

    node: str
    max_degC: float
    at_s: float
    limit_degC: float | None
    margin_K: float | None
    profile: SpotProfile | None = field(default=None, metadata=IF_SAID)


@dataclass(frozen=True, kw_only=True)
class ModelledSpot(HotSpot):
    """A hot spot of the open loop, and how sure that is. `band_from`: "calibration" or "motor file"; None where there
    is no band, and `why_no_band` says why."""

    sd_K: float | None = None
    ci95_degC: list[float] | None = None
    band_from: str | None = None
    why_no_band: str | None = field(default=None, metadata=IF_SAID)


@dataclass(frozen=True, kw_only=True)
class SmoothedSpot(HotSpot):
    """A hot spot by the smoother, with a band where there are channels that follow the node, `checked_by`."""

    sd_K: float | None
    ci95_degC: list[float] | None
    checked_by: list[str]


@dataclass(frozen=True, kw_only=True)
class DeratingCourse(Derated, DeratingRule):
    """A derating rule of the bench file beside a run. It watches `channel` to protect the hottest of `protects`:
    "winding" or "magnet"; `margin_K`: what `hottest_free_degC` left of the lowest limit there."""

    protects: str
    margin_K: float | None


@dataclass(frozen=True, kw_only=True)
class EstimatedHeat:
    """An estimated heat over a run. `sd_W`: standard deviation at any time (root mean square), `max_sd_W` at most."""

    mean_W: float
    sd_W: float
    max_W: float
    max_sd_W: float
    max_at_s: float


@dataclass(frozen=True, kw_only=True)
class HeatAtNode:
    """The loss at the filter's node: by the model, by the filter, and by the smoother where one ran."""

    modelled_mean_W: float
    filter: EstimatedHeat
    smoother: EstimatedHeat | None


@dataclass(frozen=True, kw_only=True)
class FoundUnknown:
    """A cause that the filter was asked to find, by the smoother: heat beside the modelled one [W], what a coefficient
    is multiplied by [1], or what a channel reads too much [K]. `sd` is that at any time."""

    id: str
    unit: str
    mean: float
    sd: float
    min: float
    max: float


@dataclass(frozen=True, kw_only=True)
class FilterSummary:
    """What the filter, which sees the channels `measured`, made of the run and of the loss at `node`. `mae_K`,
    `smoothed_mae_K`: of each channel that it did not see, `read_mae_K`, `smoothed_read_mae_K` of each that it did;
    `heat_bias_W`: mean of estimated minus modelled heat; `heat_walk_W_per_sqrt_s`: the random walk that made the
    readings most likely; `nis`: mean squared innovation over its variance, None where none is known; `hot_spots`: by
    the smoother."""

    node: str
    measured: list[str]
    mae_K: dict[str, float]
    smoothed_mae_K: dict[str, float] | None = None
    read_mae_K: dict[str, float] = field(default_factory=dict)
    smoothed_read_mae_K: dict[str, float] | None = None
    heat_bias_W: float
    heat_walk_W_per_sqrt_s: float
    heat: HeatAtNode | None = None
    hot_spots: dict[str, SmoothedSpot] = field(default_factory=dict)
    nis: float | None
    unknowns: list[FoundUnknown] = field(default_factory=list, metadata=IF_SAID)


@dataclass(frozen=True, kw_only=True)
class Summary:
    """A run. `integrator`: of another one than the default; `ageing`, `hours`: of a motor that asks how old its
    specimen is (hours above temperatures by feature); `note`: what the input frame had to assume; `mae_K`, `max_K`,
    `bias_K`: by node; `network_heat_W`: mean of all losses, beside it the mean of recorded electrical minus mechanical
    power, None where they were not recorded; `limits` by node; `hot_spots`: of "winding" and "magnet"; `filtered`: None
    where no filter was run."""

    session: str
    session_name: str
    kind: str
    model: str
    motor: str
    level: str
    digest: str
    integrator: IntegratorDistance | None = field(default=None, metadata=IF_SAID)
    ageing: list[Aged] = field(default_factory=list, metadata=IF_SAID)
    hours: dict[str, float] = field(default_factory=dict, metadata=IF_SAID)
    duration_s: float
    step_s: float
    note: str | None
    mae_K: dict[str, float]
    max_K: dict[str, float]
    bias_K: dict[str, float]
    channels: list[ChannelErrors]
    meters: list[MeterErrors] = field(default_factory=list)
    network_heat_W: float
    electrical_minus_mechanical_W: float | None
    losses: HeatBalance | None = None
    efficiency: Efficiency | None = None
    limits: dict[str, LimitPassed] = field(default_factory=dict)
    hot_spots: dict[str, ModelledSpot] = field(default_factory=dict)
    derating: list[DeratingCourse] = field(default_factory=list)
    filtered: FilterSummary | None = None


def document(summary: Summary) -> dict[str, Any]:
    """The JSON of a summary: an entry of `runs` of `replay --json`, but for the run's id."""
    found: dict[str, Any] = to_json(summary)
    return found


def read(stored: Mapping[str, Any]) -> Summary:
    """The summary of what `document` wrote."""
    found: Summary = from_json(Summary, stored)
    return found
