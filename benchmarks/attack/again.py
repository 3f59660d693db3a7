"""The same again: a replay under other circumstances, and what is made from facts made once more."""

from __future__ import annotations

import json
import locale
import os
import random
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext, suppress
from functools import partial
from pathlib import Path

from analytics import warehouse
from benchmarks.attack import subjects
from benchmarks.attack.children import Verb, result_of
from benchmarks.attack.outcome import Arena, Attack, Outcome
from ingest.facts.store import Store
from made.places import ROOT

CODE = (
    "import locale, sys; locale.setlocale(locale.LC_ALL, ''); from replay.cli import main; sys.exit(main(sys.argv[1:]))"
)
LOCALES = ("de_DE.UTF-8", "tr_TR.UTF-8", "C.UTF-8", "C")  # a comma in numbers, i without a dot, and what all have
CIRCUMSTANCES = (
    {"PYTHONHASHSEED": "1", "TZ": "Asia/Kolkata"},
    {"PYTHONHASHSEED": "2", "TZ": "America/St_Johns"},
    {"PYTHONHASHSEED": "4", "PYTHONOPTIMIZE": "1"},
    {"PYTHONHASHSEED": "5", "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "7"},
    {"PYTHONHASHSEED": "6", "OPENBLAS_CORETYPE": "Nehalem", "NPY_DISABLE_CPU_FEATURES": "AVX512F AVX2 FMA3"},
    {"PYTHONHASHSEED": "7", "NUMBA_CPU_NAME": "core2", "NUMBA_CPU_FEATURES": ""},
)


def circumstances(arena: Arena) -> Outcome:
    """T16: the same logs ingested in any order and replayed, by 1, 2 or 4 workers, in another zone, language and order
    of hashes, on a processor that is made to look older, and every third time on one that others keep busy."""
    outcome, chance, old, loaded, there = Outcome(), arena.chance, 0, 0, _locales()
    digests: dict[str, str] = {}
    for number in range(arena.tries):
        said = {**CIRCUMSTANCES[number % len(CIRCUMSTANCES)], "LC_ALL": chance.choice(there)}
        old += any("CPU" in key or "CORETYPE" in key for key in said)
        folder = arena.folder / "other"
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()
        for path in arena.bench.iterdir():
            if path.is_file():
                shutil.copy(path, folder)
        logs = chance.sample(["1_s1.blf", "2_drive.asc"], 2)
        workers = chance.choice(("1", "2", "4"))
        env = {**os.environ, "PYTHONPATH": str(ROOT), "WHYHOT_STORE": "store", **said}
        busy = number % 3 == 0
        loaded += busy
        with _load() if busy else nullcontext():
            for words in ([*subjects.INGEST, *logs], ["replay", "--workers", workers, "--json", "runs.json"]):
                command = [sys.executable, "-c", CODE, *words]
                done = subprocess.run(command, cwd=folder, env=env, capture_output=True, text=True, check=False)
                if done.returncode:
                    outcome.failed.append(f"{said}: {done.stderr[-300:]}")
        runs = json.loads((folder / "runs.json").read_text())["runs"] if (folder / "runs.json").exists() else []
        other = [run for run in runs if digests.setdefault(run["session"], run["digest"]) != run["digest"]]
        wrong = [f"{said}, workers {workers}, {' '.join(logs)}: {run['session']} has another digest" for run in other]
        outcome.count(*wrong, *[f"{said}: {len(runs)} replays"] * (len(runs) != 2))
    outcome.note = (
        f"{old} of them with an older processor emulated, {loaded} with as many busy processes as processors, in the "
        f"locales {', '.join(there)}; no big-endian machine"
    )
    return outcome


@contextmanager
def _load() -> Iterator[None]:
    """As many processes that only count as there are processors."""
    counting = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(os.cpu_count() or 1)]
    try:
        yield
    finally:
        for one in counting:
            one.kill()
            one.wait()


def _locales() -> list[str]:
    """Of `LOCALES` those that this machine has."""
    found, before = [], locale.setlocale(locale.LC_ALL)
    for name in LOCALES:
        with suppress(locale.Error):
            found.append(locale.setlocale(locale.LC_ALL, name))
    locale.setlocale(locale.LC_ALL, before)
    return found


def _digests(folder: Path) -> list[list[str]]:
    """What every view of a store's warehouse holds."""
    with Store.open(folder) as store, warehouse.refresh(store) as opened:
        return [list(pair) for pair in sorted(warehouse.digest(opened.connection).items())]


def _harmed(path: Path, chance: random.Random) -> str:
    data = path.read_bytes()
    at = chance.randrange(len(data))
    name, harmed = chance.choice(
        (
            ("deleted", None),
            ("cut", data[:at]),
            ("emptied", b""),
            ("a bit flipped", data[:at] + bytes([data[at] ^ 1 << chance.randrange(8)]) + data[at + 1 :]),
            ("zeroed in part", data[:at] + bytes(min(4096, len(data) - at)) + data[at + 4096 :]),
            ("a log of writes put beside", data),
        )
    )
    if harmed is None:
        path.unlink()
    else:
        path.write_bytes(harmed)
    if name.startswith("a log"):
        path.with_name(f"{path.name}.wal").write_bytes(chance.randbytes(1000))
    return name


def projections(arena: Arena) -> Outcome:
    """T17: the warehouse is harmed, or what was decoded is deleted; views are asked again, after `rebuild` where
    samples are gone."""
    outcome, chance = Outcome(), arena.chance
    true = subjects.copied(arena.bench, arena.folder / "true")
    wanted = result_of(lambda: _digests(true / "store"), arena.folder)
    for number in range(arena.tries):
        folder = subjects.copied(true, arena.folder / "other")
        how = _harmed(folder / "store" / "warehouse.duckdb", chance)
        verb = Verb(["sql", "FROM sessions"], folder)
        if number % 4 == 3:
            shutil.rmtree(folder / "store" / "decoded")
            how, verb = f"{how}, decoded files deleted", Verb(["rebuild", "--verify"], folder)
        code, said = verb.ended()
        wrong = [f"{how}: exit code {code}: {said[-300:]}"] * (code != 0)
        try:
            found = result_of(partial(_digests, folder / "store"), arena.folder)
            wrong += [f"{how}: other rows in {a[0]}" for a, b in zip(wanted, found, strict=True) if a != b]
        except RuntimeError as error:
            wrong.append(f"{how}: {str(error)[-300:]}")
        outcome.count(*wrong)
    return outcome


ATTACKS = (
    Attack("T16", "replays under other circumstances", "one digest", 100, 0, circumstances),
    Attack("T17", "harmed warehouses", "made again, equal table by table, no question asked", 200, 1, projections),
)
