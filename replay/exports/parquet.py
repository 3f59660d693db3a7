"""Rows as Parquet: unit, quantity and place of a channel lie in the metadata of its column."""

from __future__ import annotations

from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from replay.exports.samples import OutColumn, SessionRows


def write(path: Path, rows: SessionRows) -> None:
    stamped = [pa.field("time_utc", pa.timestamp("ns", tz="UTC"))] if rows.absolute else []
    since = pa.field("t_s", pa.float64(), metadata={"unit": "s"})
    own = [pa.field(one.name, pa.float64(), metadata=_metadata(one)) for one in rows.columns]
    schema = pa.schema([*stamped, since, *own], metadata={"session": rows.name})
    # Opened here: Arrow takes no path whose bytes are no UTF-8.
    with path.open("wb") as made, pq.ParquetWriter(made, schema, compression="zstd") as file:
        for t_ns, values in rows.parts:
            columns = [pa.array(t_ns, stamped[0].type)] if stamped else []
            columns += [pa.array(one, from_pandas=True) for one in (rows.seconds(t_ns), *values.T)]
            file.write_table(pa.table(columns, schema=schema))


def _metadata(column: OutColumn) -> dict[str, str]:
    said = {"unit": column.unit, "quantity": column.quantity, "place": column.place}
    return {key: text for key, text in said.items() if text}
