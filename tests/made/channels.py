"""Channels made by hand, for the tests of the catalogue."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ingest.bench.resolving import ResolvedChannel
from ingest.catalogue.channels import ChannelData
from ingest.texts.quantities import STORED_UNIT, Conversion

RAW = "a" * 64


def channel(name: str, quantity: str, value: ArrayLike, rate_Hz: float = 1.0, **more: Any) -> ChannelData:
    """One channel of one file, from time 0 at a fixed rate; `t_s` gives other stamps, `raw` another file."""
    values = np.asarray(value, dtype=np.float64)
    stamps = np.asarray(more.pop("t_s", np.arange(len(values)) / rate_Hz), dtype=np.float64)
    raw = more.pop("raw", RAW)
    spec: dict[str, Any] = {"role": "input", "unit": STORED_UNIT[quantity], "conversion": Conversion(), "signals": ()}
    return ChannelData(
        spec=ResolvedChannel(name=name, quantity=quantity, **(spec | more)),
        t_ns=np.round(stamps * 1e9).astype(np.int64),
        value=values,
        record=np.arange(len(values)),
        raw=np.zeros(len(values), np.int64),
        raws=(raw,),
    )


def logged(first: int, last: int, *, step: float, rest: float = 1.0) -> list[ChannelData]:
    """Speed, torque, current and three temperatures that repeat one record from `first` to `last`, resolved to `step`
    of their noise, which is `rest` times as large meanwhile."""
    own = {"speed": 1500.0, "torque": 40.0, "current": 100.0, "T_a": 60.0, "T_b": 50.0, "T_c": 40.0}
    found = []
    for i, (name, level) in enumerate(own.items()):
        draws = np.random.default_rng(i).normal(0, 1, 3600)
        draws[first : last + 1] = draws[first] if rest == 0.0 else rest * draws[first : last + 1]
        value = level + np.round(draws / step) * step
        observed = name.startswith("T_")
        more: dict[str, Any] = {"role": "observed", "node": name[2:]} if observed else {}
        found.append(channel(name, "temperature" if observed else name, value, **more))
    return found
