"""What a run leaves in the archive: input frame, temperatures, residuals and the filter's estimate, as Parquet."""

from __future__ import annotations

import io
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from ingest.texts.quantities import column_suffix
from replay.engine.frame.frame import InputFrame
from replay.engine.results.run import Compared, Filtered, HeatCourse, Metered, Observed, Smoothed
from replay.engine.results.summary import FilterSummary

Floats = NDArray[np.float64]

AROUND = ("speed_rpm", "torque_Nm", "current_A")  # inputs repeated beside each residual


def to_parquet(table: pa.Table) -> bytes:
    """One Parquet file, page checksums on."""
    sink = io.BytesIO()
    pq.write_table(
        table, sink, compression="zstd", compression_level=1, write_page_checksum=True, write_statistics=False
    )
    return sink.getvalue()


def table_writer(path: Path, schema: pa.Schema) -> pq.ParquetWriter:
    """The same as a file that is written part by part."""
    return pq.ParquetWriter(
        path, schema, compression="zstd", compression_level=1, write_page_checksum=True, write_statistics=False
    )


def read_parquet(data: bytes) -> pa.Table:
    """The table again, page checksums verified."""
    return pq.read_table(io.BytesIO(data), page_checksum_verification=True)


def frame_table(frame: InputFrame) -> pa.Table:
    """One row a step: everything that enters the twin, and the lineage of every observed mean."""
    columns: dict[str, Any] = {"t_ns": frame.t_ns[:-1], "live": frame.live}
    columns |= {f"feature:{m.name}": frame.features[:, i] for i, m in enumerate(frame.monomials)}
    columns |= {f"boundary:{name}": frame.boundaries[:, i] for i, name in enumerate(frame.boundary_names)}
    columns |= {f"input:{name}": values for name, values in frame.inputs.items()}
    observed = [("temperature", o) for o in frame.observations] + [(m.what.quantity, m.seen) for m in frame.meters]
    for quantity, o in observed:
        name, measured = o.sensor.name, f"measured{column_suffix(quantity)}"
        columns |= {f"{name}:{measured}": o.measured, f"{name}:samples": o.samples}
        columns |= {f"{name}:first_record": o.first_record, f"{name}:last_record": o.last_record, f"{name}:file": o.raw}
    if frame.mechanical_W is not None:
        columns["mechanical_W"] = frame.mechanical_W
    return pa.table(columns).replace_schema_metadata(
        {"step_s": repr(frame.step_s), "files": json.dumps(frame.raw_files)}
    )


def temperature_table(frame: InputFrame, temperatures: Floats, nodes: Sequence[str], heat: Floats) -> pa.Table:
    """One row an edge of a step, N + 1; a column a node, and the network's heat in the step that begins there [W]."""
    columns = {f"{node}_degC": temperatures[:, i] for i, node in enumerate(nodes)}
    return pa.table({"t_ns": frame.t_ns, **columns, "network_heat_W": np.append(heat, np.nan)})


def filtered_table(frame: InputFrame, filtered: Filtered, nodes: Sequence[str]) -> pa.Table:
    """One row an edge of a step, N + 1: a column a node, and the heat [W] in the step that begins there as estimated,
    with its standard deviation, and as modelled; then temperatures and heat once more, as smoothed."""
    columns = {f"{node}_degC": filtered.temperatures[:, i] for i, node in enumerate(nodes)}
    heat = {"estimated_heat_W": filtered.heat_W, "estimated_heat_sd_W": filtered.heat_sd_W}
    heat["nominal_heat_W"] = filtered.nominal_W
    if filtered.smoothed is not None:
        smooth = filtered.smoothed
        columns |= {f"{node}_smoothed_degC": smooth.temperatures[:, i] for i, node in enumerate(nodes)}
        heat |= {"smoothed_heat_W": smooth.heat_W, "smoothed_heat_sd_W": smooth.heat_sd_W}
    steps = {name: np.append(values, np.nan) for name, values in heat.items()}
    return pa.table({"t_ns": frame.t_ns, **columns, **steps})


def filtered_of(table: pa.Table, summary: FilterSummary, nodes: Sequence[str]) -> Filtered:
    """The estimate that `filtered_table` wrote into a table; `summary`: what the run says of it."""

    def steps(*names: str) -> list[Floats]:
        return [table[name].to_numpy()[:-1] for name in names]

    def edges(ending: str) -> Floats:
        return np.stack([table[f"{node}{ending}"].to_numpy() for node in nodes], axis=1)

    heat, sd, nominal = steps("estimated_heat_W", "estimated_heat_sd_W", "nominal_heat_W")
    smoothed = None
    if "smoothed_heat_W" in table.column_names:
        smoothed = Smoothed(edges("_smoothed_degC"), *steps("smoothed_heat_W", "smoothed_heat_sd_W"))
    return Filtered(
        node=summary.node,
        measured=tuple(summary.measured),
        temperatures=edges("_degC"),
        heat_W=heat,
        heat_sd_W=sd,
        nominal_W=nominal,
        heat_walk_W=summary.heat_walk_W_per_sqrt_s,
        nis=float("nan") if summary.nis is None else summary.nis,
        smoothed=smoothed,
    )


def heat_table(frame: InputFrame, heat: HeatCourse) -> pa.Table:
    """One row a step, means over it: losses by kind (`loss:copper_dc_W`), what boundaries take (`into:coolant_W`)."""
    losses = {f"loss:{kind}_W": values for kind, values in heat.kinds.items()}
    taken = {f"into:{name}_W": values for name, values in heat.boundaries.items()}
    return pa.table({"t_ns": frame.t_ns[:-1], **losses, **taken})


def heat_of(table: pa.Table) -> HeatCourse:
    """The courses of heat that `heat_table` wrote into a table."""

    def of(kind: str) -> dict[str, Floats]:
        names = [name for name in table.column_names if name.startswith(kind)]
        return {name.removeprefix(kind).removesuffix("_W"): table[name].to_numpy() for name in names}

    return HeatCourse(kinds=of("loss:"), boundaries=of("into:"))


def meter_table(frame: InputFrame, meters: Sequence[Metered]) -> pa.Table:
    """Long: one row an observed meter and step, numbers in the `unit` of its quantity."""
    names = ("measured", "modelled", "residual", "sd")
    said = [{"channel": m.channel, "quantity": m.quantity, "unit": m.unit, "place": m.place} for m in meters]
    tables = (_steps(frame, m, own, names, m.floor) for m, own in zip(meters, said, strict=True))
    return pa.concat_tables([pa.table(table) for table in tables])


def residual_table(frame: InputFrame, observed: Sequence[Observed]) -> pa.Table:
    """Long: one row an observed channel and step."""
    return pa.concat_tables([_residuals(frame, o) for o in observed])


def _residuals(frame: InputFrame, o: Observed) -> pa.Table:
    at, missing = steps_of(frame, o), np.full(o.t_ns.size, np.nan)
    names = ("measured_degC", "modelled_degC", "residual_K", "sd_K")
    steps = _steps(frame, o, {"channel": o.channel, "node": o.node}, names, o.floor_K)
    return pa.table({**steps, **{name: frame.inputs[name][at] if name in frame.inputs else missing for name in AROUND}})


def _steps(
    frame: InputFrame, o: Compared, said: Mapping[str, str], names: Sequence[str], floor: float
) -> dict[str, Any]:
    """The columns of a channel, a row a step. `said`: texts, the same in each row; `names` of the columns of numbers,
    the last of which has `floor` in each row."""
    files, size = pa.array([*frame.raw_files, None], pa.string()), o.t_ns.size
    return {
        "t_ns": o.t_ns,
        "t_s": (o.t_ns - frame.t_ns[0]) / 1e9,
        **{name: pa.array([value] * size, pa.string()) for name, value in said.items()},
        **dict(zip(names, (o.measured, o.modelled, o.residual, np.full(size, floor)), strict=True)),
        "used": o.used,
        "file_id": files.take(pa.array(o.raw)),
        "first_record": o.first_record,
        "last_record": o.last_record,
    }


def steps_of(frame: InputFrame, o: Compared) -> NDArray[np.int64]:
    """The step that each observed mean belongs to, (M,)."""
    step: NDArray[np.int64] = (o.t_ns - frame.t_ns[0]) // np.int64(frame.t_ns[1] - frame.t_ns[0])
    return step
