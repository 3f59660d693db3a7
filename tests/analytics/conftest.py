"""A small store, made by hand: three sessions, two of them rows of one table; one run of the first; one broken file."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from ingest.facts.durable import sha256_of
from ingest.facts.events import (
    BenchRegistered,
    DecodeCompleted,
    RawFileSealed,
    ReplayCompleted,
    SessionRecorded,
)
from ingest.facts.store import Store
from made.places import on_disk

SECOND = 1_000_000_000
START = 1_760_000_000 * SECOND
ABSENT = float("nan")


def channel(name: str, group: str, quantity: str | None, unit: str, node: str | None = None) -> dict[str, object]:
    role = "observed" if node else "input"
    return {"name": name, "group": group, "column": f"{name}_{unit}", "quantity": quantity, "unit": unit} | {
        "node": node,
        "role": role,
        "derived": False,
    }


def write_group(
    store: Store, decode: str, group: str, raw: str, t_ns: list[int], columns: dict[str, list[object]]
) -> None:
    """One Parquet file of a decode, in the layout of `ingest.log.samples`."""
    folder = on_disk(store.decoded(decode))
    folder.mkdir(exist_ok=True)
    fixed = {"t_ns": t_ns, "log_t_ns": t_ns, "file_id": [raw] * len(t_ns), "record": list(range(len(t_ns)))}
    pq.write_table(pa.table({**fixed, **columns}), folder / f"{group}.parquet", use_dictionary=["file_id"])


def decoded(
    store: Store,
    raw: str,
    decode: str,
    bench: str | None,
    found: int,
    channels: list[dict[str, object]],
    **more: object,
) -> None:
    """Append what `ingest` appends of a log: sealed, decoded."""
    stream = f"file-{raw}"
    store.ledger.append(stream, RawFileSealed(sha256=raw, name=str(more.pop("name")), size=100, format="csv"))
    groups = [
        {"name": str(group), "file": f"{group}.parquet"} for group in sorted({str(one["group"]) for one in channels})
    ]
    lost = {"unknown_id": 0, "wrong_length": 0, "rejected": 0, **more.pop("lost", {})}  # type: ignore[dict-item]
    store.ledger.append(
        stream,
        DecodeCompleted(
            decode=decode,
            raw=raw,
            bench=bench,
            databases=[],
            decoder="1",
            outcome=str(more.pop("outcome", "decoded")),
            why=more.pop("why", None),  # type: ignore[arg-type]
            absolute=bool(more.pop("absolute", True)),
            start_ns=START,
            end_ns=START + 9 * SECOND,
            balance={"found": found, "decoded": found - sum(lost.values()), **lost},
            groups=groups,
            channels=channels,
            products={path.name: sha256_of(path) for path in on_disk(store.decoded(decode)).glob("*.parquet")},
        ),
    )


def session(
    name: str, raw: str, decode: str, bench: str | None, first: int, last: int, **more: object
) -> SessionRecorded:
    """A session of one file."""
    said = {"kind": "s1", "kind_why": "given by the bench file", "specimen": None, "batch": None} | more
    return SessionRecorded(
        session=f"{name}-id",
        name=name,
        bench=bench,
        configuration=None,
        attributes={"inverter": "sw 4.2"},
        absolute=bool(said.pop("absolute", True)),
        start_ns=START + first * SECOND,
        end_ns=START + last * SECOND,
        files=[{"raw": raw, "decode": decode, "first_record": first, "last_record": last}],
        **said,  # type: ignore[arg-type]
    )


def add_run(store: Store, run: str, raw: str, session_id: str) -> None:
    """A sealed run: residuals of one channel in two steps, temperatures of two nodes."""
    step_ns = [START + SECOND, START + 6 * SECOND]
    residuals = {
        "t_ns": step_ns,
        "t_s": [1.0, 6.0],
        "channel": ["MAG_1"] * 2,
        "node": ["magnet"] * 2,
        "measured_degC": [21.0, 26.0],
        "modelled_degC": [20.5, 23.0],
        "residual_K": [0.5, 3.0],
        "sd_K": [0.1, 0.1],
        "used": [True, True],
        "file_id": [raw] * 2,
        "first_record": [0, 5],
        "last_record": [3, 8],
        "speed_rpm": [1000.0, 2000.0],
        "torque_Nm": [5.0, ABSENT],
    }  # without current_A: the session has none
    temperatures = {"t_ns": step_ns, "magnet_degC": [20.5, 23.0], "shaft_degC": [30.0, 31.0]}
    sealed = {}
    for kind, columns in (("residuals", residuals), ("temperatures", temperatures)):
        path = store.work() / "made.parquet"
        pq.write_table(pa.table(columns), path)
        sealed[kind] = store.archive.seal(path)
    store.ledger.append(
        f"run-{run}",
        ReplayCompleted(
            run=run,
            session=session_id,
            model="m" * 64,
            motor="reference",
            level="testing",
            bench="b" * 64,
            key={"seed": 0},
            digest="d" * 64,
            environment={"python": "3.11"},
            artefacts=sealed,
            summary={"mae_K": {"magnet": 1.75, "shaft": 0.25}, "max_K": {"magnet": -3.0, "shaft": 0.5}},
        ),
    )


@pytest.fixture
def new_session() -> Callable[..., SessionRecorded]:
    """Makes a session of one file, to be appended: name, raw, decode, bench, first and last record."""
    return session


@contextmanager
def small_store(folder: Path) -> Iterator[Store]:
    with Store.open(folder / "it's a store", create=True) as made:
        bench, drive, table, broken = "b" * 64, "1" * 64, "2" * 64, "3" * 64
        made.ledger.append(
            f"bench-{bench}", BenchRegistered(sha256=bench, name="bench.toml", motor="reference", model="m" * 64)
        )
        t_ns = [START + i * SECOND for i in range(10)]
        ramp = [20.0 + i for i in range(10)]
        write_group(made, "d1", "temps", drive, t_ns, {"MAG_1_degC": [*ramp[:9], ABSENT], "mag_1_degC": [0.0] * 10})
        write_group(
            made, "d1", "drive", drive, t_ns, {"speed_rpm": [100.0 * i for i in range(10)], "mode": ["on"] * 10}
        )
        decoded(
            made,
            drive,
            "d1",
            bench,
            12,
            [
                channel("MAG_1", "temps", "temperature", "degC", "magnet"),
                channel("mag_1", "temps", "temperature", "degC"),
                channel("speed", "drive", "speed", "rpm"),
                {"name": "mode", "group": "drive", "column": "mode", "quantity": None, "unit": None, "node": None},
            ],
            name="1_s1.blf",
            lost={"unknown_id": 1, "rejected": 1},
        )
        write_group(made, "d2", "rows", table, t_ns, {"oven_degC": list(np.linspace(180.0, 189.0, 10))})
        decoded(made, table, "d2", bench, 10, [channel("oven", "rows", "temperature", "degC", "oven")], name="oven.csv")
        decoded(made, broken, "d3", None, 0, [], name="bad.blf", outcome="quarantined", why="bad.blf: is empty")
        for one in (
            session("1_s1", drive, "d1", bench, 0, 11),
            session("oven_a", table, "d2", bench, 0, 4, kind="ageing", specimen="stator-07", batch="B3"),
            session("oven_b", table, "d2", bench, 5, 9, kind="ageing", specimen="stator-08", absolute=False),
        ):
            made.ledger.append(f"session-{one.session}", one)
        add_run(made, "r1", drive, "1_s1-id")
        yield made


@pytest.fixture
def store(tmp_path: Path) -> Iterator[Store]:
    """The small store, open for writing."""
    with small_store(tmp_path) as made:
        yield made


@pytest.fixture(scope="module")
def shared_store(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Store]:
    """The same, for tests that change nothing in it."""
    with small_store(tmp_path_factory.mktemp("shared")) as made:
        yield made
