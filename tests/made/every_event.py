"""A store with every kind of event, by the verbs that write them.

`PYTHONPATH=.:tests python -m made.every_event NAME` packs one as `tests/stores/NAME.tar.xz`, and what it says beside it
as `NAME.json`. Run it where a kind of event is new, under a new NAME: a store that is there stays as it is.
"""

from __future__ import annotations

import json
import os
import sys
import tarfile
from contextlib import chdir
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from unittest.mock import patch

from benchmarks.attack.subjects import CHECKS, DIAGNOSE, INGEST, write_table
from ingest.facts import facts
from ingest.facts.store import Store
from made import can_bench
from made.places import ROOT
from replay.cli import main

STORES = ROOT / "tests" / "stores"
EXCHANGED = ("winding", "magnet", "yoke")  # where the sensors at winding, yoke and magnet are said to be


def said(folder: Path) -> dict[str, Any]:
    """What a store says: its head, and each fact that counts."""
    with Store.open(folder) as store:
        known, head = facts.at(store.ledger), store.ledger.head()
    return {
        "head": str(head),
        "logs": {sha256: one.name for sha256, one in known.files.items()},
        "products": {one.decode: dict(one.products) for one in known.decodes.values()},
        "sessions": [[one.session, one.name, one.kind, one.specimen] for one in known.sessions],
        "runs": {one.run: one.digest for one in known.runs.values()},
        "taken back": sorted(known.retractions),
        "inspections": sorted(known.inspections),
    }


def _every_event() -> None:
    """The store, as `store` in this folder. Raises RuntimeError where a command fails."""
    os.environ["WHYHOT_STORE"] = "store"
    _logs()
    _answers()
    _people()


def _logs() -> None:
    """Two logs of one test, of which the second one is late; one that is to go; two loggers of one speed."""
    can_bench.write_files(Path())
    can_bench.write_log(Path("1_s1.blf"), seconds=60)
    can_bench.write_log(Path("1_late.blf"), seconds=30, start=can_bench.START + 60)
    can_bench.write_log(Path("2_gone.asc"), seconds=10, start=can_bench.START + 86_400)
    for log in ("1_s1.blf", "1_late.blf", "2_gone.asc"):
        _run(*INGEST, log)
    _two_loggers()
    _run("morning", "bench.csv", "analyser.csv", "--bench", "two.toml", "--ingest")


def _two_loggers() -> None:
    """Two tables, of which one is stamped 7 s late and has a gap of a minute."""
    speed, _ = can_bench.drive(900, seed=5)
    bench = 'schema = "whyhot.bench/1"\n'
    for name, late_s, seconds in (("bench", 0, range(900)), ("analyser", 7, [*range(400), *range(460, 900)])):
        rows = [f"{int(can_bench.START) + 172_800 + late_s + k},{speed[10 * k]:.0f}" for k in seconds]
        Path(f"{name}.csv").write_text("\n".join([f"time,n_{name}", *rows]) + "\n", encoding="utf-8")
        bench += f'[[channel]]\nsignal = "n_{name}"\nquantity = "speed"\nunit = "rpm"\n'
    Path("two.toml").write_text(bench, encoding="utf-8")


def _answers() -> None:
    """Two runs of one key that differ, a calibration, a diagnosis that was accepted, an assessment of insulation."""
    _run("replay", "1_s1")
    with patch("replay.engine.runs.runs.digest_of", lambda columns: "0" * 64):
        _run("replay", "1_s1", code=2)
    write_table(Path("4_learn.csv"), 960, 3, EXCHANGED)
    write_table(Path("5_kept.csv"), 960, 4, EXCHANGED)
    _run("ingest", "--bench", "bench.toml", "4_learn.csv", "5_kept.csv")
    _run("calibrate", "--on", "4_learn")
    _run(*DIAGNOSE)
    with Store.open(Path("store")) as store:
        (diagnosis,) = facts.at(store.ledger).diagnoses
    _run("accept", diagnosis)
    rows = [f"S{one},B1,{300 * check},{0.2 + 0.01 * check * one}" for one in range(3) for check in range(4)]
    Path("checks.csv").write_text("\n".join(["specimen,batch,dose_h,R_th", *rows]) + "\n", encoding="utf-8")
    Path("checks.toml").write_text(CHECKS, encoding="utf-8")
    _run("ingest", "checks.csv", "--bench", "checks.toml")
    _run("ageing")


def _people() -> None:
    """What people find, correct, take back, bring back, and have to delete."""
    _run("attach", "motor.toml", "--specimen", "servo-01", "--finding", "crack")
    _run("correct", "1_s1.blf", "--specimen", "servo-02", "--reason", "misread")
    _run("retract", "bench", "--reason", "the wrong motor")
    _run("retract", "bench", "--reason", "it was the right one", "--undo")
    _run("retract", "4_learn", "--reason", "the wrong motor")
    _run("forget", "2_gone.asc", "--reason", "the contract ended")


def _run(*words: str, code: int = 0) -> None:
    """A command of ours, that ends with `code`. Raises RuntimeError where it does not."""
    if (ended := main(list(words))) != code:
        raise RuntimeError(f"{' '.join(words)}: exit code {ended}")


def _pack(name: str) -> None:
    with TemporaryDirectory() as folder, chdir(folder):
        _every_event()
        with tarfile.open(STORES / f"{name}.tar.xz", "x:xz", preset=9) as packed:
            packed.add("store", filter=_by_nobody)
        (STORES / f"{name}.json").write_text(json.dumps(said(Path("store")), indent=1) + "\n", encoding="utf-8")


def _by_nobody(member: tarfile.TarInfo) -> tarfile.TarInfo:
    member.uid = member.gid = 0
    member.uname = member.gname = ""
    return member


if __name__ == "__main__":
    _pack(sys.argv[1])
