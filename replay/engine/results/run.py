"""What a replay gives: temperatures of every node, and what each observed channel says of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from replay.engine.results.summary import Summary


@dataclass(frozen=True, kw_only=True)
class Compared:
    """A channel beside the model, at the M steps in which it has a sample. All arrays (M,).

    `measured`: mean of the samples in the step; `modelled`: what the model would read at their mean time `t_ns`;
    `used`: False where samples are held, stuck, saturated or follow a bridged gap of an input; `first_record`,
    `last_record`: of the samples, in the file at index `raw` of the session's.
    """

    channel: str
    t_ns: NDArray[np.int64]
    measured: NDArray[np.float64]
    modelled: NDArray[np.float64]
    used: NDArray[np.bool_]
    first_record: NDArray[np.int64]
    last_record: NDArray[np.int64]
    raw: NDArray[np.int64]

    def between(self, begin_ns: int, end_ns: int) -> Self:
        """The part of it from one moment to before another."""
        there = (self.t_ns >= begin_ns) & (self.t_ns < end_ns)
        own: dict[str, Any] = {name: a[there] for name, a in vars(self).items() if isinstance(a, np.ndarray)}
        return replace(self, **own)

    @property
    def residual(self) -> NDArray[np.float64]:
        """measured - modelled, (M,)."""
        return self.measured - self.modelled

    @property
    def usable(self) -> NDArray[np.bool_]:
        """Where the residual is known and may be used, (M,)."""
        return self.used & np.isfinite(self.residual)


@dataclass(frozen=True, kw_only=True)
class Observed(Compared):
    """A thermometer beside the model [degC]. `node`: the one that it follows by more than half, else "0.5 a + 0.5 b";
    `sd_K`: of a mean, by noise and resolution; `bias_sd_K`: of its error that is constant in a session."""

    node: str
    sd_K: float
    bias_sd_K: float

    @property
    def floor_K(self) -> float:
        """What the sensor itself leaves open, one standard deviation of a mean."""
        return float(np.hypot(self.sd_K, self.bias_sd_K))


@dataclass(frozen=True, kw_only=True)
class Metered(Compared):
    """Another meter beside the model, in the `unit` of its `quantity`. `place`: the nodes or the boundary that it is
    about, "motor" of a power; `sd`, `bias_sd` as of a thermometer; `gain_sd`: of the share that it reads too much."""

    quantity: str
    unit: str
    place: str
    sd: float
    bias_sd: float
    gain_sd: float

    @property
    def floor(self) -> float:
        """What the meter itself leaves open, one standard deviation of a mean: noise, offset, gain of the mean size."""
        used = np.abs(self.modelled[self.used])
        size = float(used.mean()) if used.size else 0.0
        return float(np.hypot(np.hypot(self.sd, self.bias_sd), self.gain_sd * size))


@dataclass(frozen=True)
class HeatCourse:
    """Where the heat of a run comes from and goes to, step by step. Means over the steps (N,) [W]: `kinds` the losses
    by kind (`twin.run.losses.KINDS`), `boundaries` what each takes."""

    kinds: Mapping[str, NDArray[np.float64]]
    boundaries: Mapping[str, NDArray[np.float64]]


@dataclass(frozen=True)
class Smoothed:
    """What smoothing makes of a session: each moment judged by all readings, those after it included. `temperatures`
    float64 (N + 1, n) [degC]; per step (N,) [W] `heat_W` the estimated heat and `heat_sd_W` its standard deviation."""

    temperatures: NDArray[np.float64]
    heat_W: NDArray[np.float64]
    heat_sd_W: NDArray[np.float64]


@dataclass(frozen=True)
class Filtered:
    """The same session through the filter, which sees the channels `measured` and estimates the heat at `node`.

    `temperatures` float64 (N + 1, n) [degC], from all readings up to each edge; per step (N,) [W]: `heat_W` the
    estimated heat, `heat_sd_W` its standard deviation, `nominal_W` what the model has there. `heat_walk_W` [W /
    sqrt(s)]: how fast the estimate may wander; `nis`: mean squared innovation over its variance, 1 where all is as
    assumed; `smoothed`: None in runs that were sealed without.
    """

    node: str
    measured: tuple[str, ...]
    temperatures: NDArray[np.float64]
    heat_W: NDArray[np.float64]
    heat_sd_W: NDArray[np.float64]
    nominal_W: NDArray[np.float64]
    heat_walk_W: float
    nis: float
    smoothed: Smoothed | None = None


@dataclass(frozen=True)
class Run:
    """An open-loop replay of one session with one model.

    `t_ns` int64 (N + 1,) step boundaries; `temperatures` float64 (N + 1, n) [degC] in the order of `nodes`; `inputs`:
    column name with unit -> (N,) step means (`speed_rpm`, `current_A`, `coolant_degC`, ...); `losses_W` (N,) the
    network's whole heat; `summary`: the same in numbers; `filtered`: None where no filter was run; `heat`:
    None of runs that were sealed before there was one.
    """

    run: str
    session: str
    session_name: str
    kind: str
    model: str
    motor: str
    level: str
    digest: str
    nodes: tuple[str, ...]
    regions: Mapping[str, str]  # node -> region
    limits_degC: Mapping[str, float]
    t_ns: NDArray[np.int64]
    absolute: bool
    temperatures: NDArray[np.float64]
    inputs: Mapping[str, NDArray[np.float64]]
    losses_W: NDArray[np.float64]
    observed: tuple[Observed, ...]
    summary: Summary
    filtered: Filtered | None = None
    meters: tuple[Metered, ...] = ()
    heat: HeatCourse | None = None

    def between(self, begin_ns: int, end_ns: int) -> Run:
        """The part of its courses from one moment to before another, with the summary of the whole, and without what a
        filter said."""
        first, last = np.searchsorted(self.t_ns, [begin_ns, end_ns]).tolist()
        edges, steps = slice(first, last), slice(first, max(first, last - 1))
        heat = self.heat and HeatCourse(
            {kind: watts[steps] for kind, watts in self.heat.kinds.items()},
            {name: watts[steps] for name, watts in self.heat.boundaries.items()},
        )
        return replace(
            self,
            t_ns=self.t_ns[edges],
            temperatures=self.temperatures[edges],
            inputs={name: means[steps] for name, means in self.inputs.items()},
            losses_W=self.losses_W[steps],
            observed=tuple(one.between(begin_ns, end_ns) for one in self.observed),
            filtered=None,
            meters=tuple(one.between(begin_ns, end_ns) for one in self.meters),
            heat=heat,
        )
