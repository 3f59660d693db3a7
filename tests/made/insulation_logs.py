"""Logs of ovens and checks of insulation as an ingest leaves them, made by hand."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import ArrayLike

from ingest.facts.durable import sha256_of
from ingest.facts.events import DecodeCompleted, RawFileSealed, SessionRecorded
from ingest.facts.store import Store
from ingest.texts.quantities import STORED_UNIT
from made.places import on_disk

HOUR_s = 3600
START_NS = 1_760_000_000 * 10**9
STEP_s = 10.0
Columns = dict[str, tuple[str, str | None, ArrayLike]]  # channel -> quantity, node, values


def decoded_anew(store: Store, raw: str) -> None:
    """Append that the log was decoded once more, to what lies in its folder now."""
    last = store.ledger.events(DecodeCompleted, stream=f"file-{raw}")[-1].event
    assert isinstance(last, DecodeCompleted)
    products = {path.name: sha256_of(path) for path in on_disk(store.decoded(last.decode)).iterdir()}
    store.ledger.append(f"file-{raw}", DecodeCompleted(**{**vars(last), "products": products}))


def add_log(
    store: Store, name: str, kind: str, at_h: float | None, columns: Columns, step_s: float = STEP_s, **more: Any
) -> None:
    """Append a session of one file: sealed, decoded, recorded. `at_h`: hours since the first of them, None without
    absolute time; `more`: what else is said of the session."""
    raw, decode = name.encode().hex().ljust(64, "0"), name.encode().hex()
    size = len(np.asarray(next(iter(columns.values()))[2]))
    start = START_NS + round((at_h or 0.0) * HOUR_s * 1e9)
    t_ns = start + np.round(np.arange(size) * step_s * 1e9).astype(np.int64)
    kept = np.setdiff1d(np.arange(size), more.pop("lost", []))
    folder = on_disk(store.decoded(decode))
    folder.mkdir()
    fixed = {"t_ns": t_ns[kept], "log_t_ns": t_ns[kept], "file_id": [raw] * len(kept), "record": kept}
    values = {channel: np.asarray(value, np.float64)[kept] for channel, (_, _, value) in columns.items()}
    pq.write_table(pa.table({**fixed, **values}), folder / "rows.parquet")
    ignored, regions = more.pop("ignored", ()), more.pop("regions", None)
    channels: list[dict[str, Any]] = [
        {
            "name": channel,
            "group": "rows",
            "column": channel,
            "quantity": quantity,
            "unit": STORED_UNIT[quantity],
            "node": node,
            "role": "ignored" if channel in ignored else "observed" if node else "input",
            "derived": False,
            **({"region": regions.get(channel)} if regions else {}),
        }
        for channel, (quantity, node, _) in columns.items()
    ]
    absolute, first, last = at_h is not None, int(t_ns[0]), int(t_ns[-1])
    balance = {"found": len(kept), "decoded": len(kept), "unknown_id": 0, "wrong_length": 0, "rejected": 0}
    said: dict[str, Any] = {"specimen": "stator-07", "batch": None} | more
    file = {"raw": raw, "decode": decode, "first_record": 0, "last_record": size - 1}
    store.ledger.append(f"file-{raw}", RawFileSealed(sha256=raw, name=f"{name}.csv", size=1, format="csv"))
    store.ledger.append(
        f"file-{raw}",
        DecodeCompleted(
            decode=decode, raw=raw, bench=None, databases=[], decoder="1", outcome="decoded", why=None,
            balance=balance,
            groups=[{"name": "rows", "file": "rows.parquet"}], channels=channels,
            absolute=absolute, start_ns=first, end_ns=last,
            products={"rows.parquet": sha256_of(folder / "rows.parquet")},
        ),
    )  # fmt: skip
    store.ledger.append(
        f"session-{decode}",
        SessionRecorded(
            session=decode, name=name, kind=kind, kind_why="given", bench=None, configuration=None, attributes={},
            files=[file], absolute=absolute, start_ns=first, end_ns=last, **said,
        ),
    )  # fmt: skip
