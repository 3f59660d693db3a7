"""Stores under attack from outside: killed writers, full disks, writers at once. Each part runs in its own process."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="needs fork, kill -9 and file size limits")

COMMON = """
import gc, json, os, random, resource, signal, sys, time
from pathlib import Path
from ingest.facts import ledger_lock
from ingest.errors import IngestError
from ingest.facts.events import RawFileSealed
from ingest.facts.store import Store
from ingest.facts.store_check import damage

folder, count = Path(sys.argv[1]), int(sys.argv[2])

def put(store, text):
    # one command's worth: a blob, a product, an event; returns when all is on disk
    sha256 = store.archive.seal(text.encode() * 50)
    made = store.work()
    (made / "recording.mcap").write_text(text)
    store.publish(made, f"d{sha256[:16]}")
    event = RawFileSealed(sha256=sha256, name=text, size=50 * len(text), format=None)
    store.ledger.append(f"file-{sha256}", event)

def names():
    with Store.open(folder) as store:
        return [one.event.name for one in store.ledger.events(RawFileSealed)]

def findings():
    with Store.open(folder) as store:
        return damage(store)
"""

KILLS = """
def child(pipe, batch):
    with Store.open(folder, create=True) as store:
        for number in range(1000):
            put(store, f"{batch}-{number}")
            os.write(pipe, f"{batch}-{number}\\n".encode())

rng, acknowledged, lost, found = random.Random(1), [], [], []
for batch in range(count):
    reads, writes = os.pipe()
    pid = os.fork()
    if pid == 0:
        child(writes, batch)
    os.close(writes)
    with os.fdopen(reads) as pipe:
        if batch % 3:  # kill while it appends; else while it opens the store
            acknowledged.append(pipe.readline().strip())
        time.sleep(rng.uniform(0, 0.03))
        os.kill(pid, signal.SIGKILL)
        os.waitpid(pid, 0)
        acknowledged += pipe.read().split()
    if (folder / "store.json").exists():
        found += findings()
        lost += set(acknowledged) - set(names())
with Store.open(folder, create=True) as store:
    put(store, "last")
there = names()
print(json.dumps({
    "acknowledged": len(acknowledged), "lost": lost, "doubled": len(there) - len(set(there)),
    "found": found + findings(),
    "unasked": len(there) - 1 - len(acknowledged), "tmp": len(list((folder / "tmp").iterdir())),
}))
"""

FULL_DISK = """
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
with Store.open(folder, create=True) as store:
    put(store, "first")
said, found, unlimited = [], [], resource.getrlimit(resource.RLIMIT_FSIZE)
for number in range(count):
    text = str(number) * 400
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000 + 1500 * number, unlimited[1]))
    try:
        with Store.open(folder, write=True) as store:
            put(store, text)
    except (IngestError, OSError) as error:
        said.append(str(error))
    resource.setrlimit(resource.RLIMIT_FSIZE, unlimited)
    gc.collect()  # a command ends with its process, and what SQLite still held open ends with it
    found += findings()
    if text not in names():
        with Store.open(folder, write=True) as store:
            put(store, text)
there = names()
print(json.dumps({"said": said, "found": found + findings(), "there": len(set(there)), "rows": len(there)}))
"""

AT_ONCE = """
ledger_lock.WAIT_S = 30.0
def child(writer):
    for number in range(count):
        with Store.open(folder, create=True) as store:
            put(store, f"{writer}-{number}")

children = []
for writer in range(3):
    pid = os.fork()
    if pid == 0:
        child(writer)
        os._exit(0)
    children.append(pid)
read = 0
while not (folder / "store.json").exists():
    time.sleep(0.001)
while len(names()) < 3 * count and read < 10_000:
    read += 1
codes = [os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) for pid in children]
print(json.dumps({"codes": codes, "names": sorted(names()), "found": findings(), "read": read}))
"""


def attack(script: str, folder: Path, count: int) -> dict[str, Any]:
    command = [sys.executable, "-c", COMMON + script, str(folder), str(count)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    result: dict[str, Any] = json.loads(done.stdout)
    return result


def test_what_was_acknowledged_survives_a_kill_at_any_time(tmp_path: Path) -> None:
    result = attack(KILLS, tmp_path / "store", 40)
    assert result["acknowledged"] >= 26  # one of each of the 26 children that are killed while they append
    assert result["lost"] == []
    assert result["found"] == []
    assert result["doubled"] == 0
    assert 0 <= result["unasked"] <= 40  # stored, but killed before it could say so
    assert result["tmp"] == 0


def test_a_full_disk_is_one_sentence_and_the_same_command_works_after(tmp_path: Path) -> None:
    result = attack(FULL_DISK, tmp_path / "store", 40)
    assert 10 <= len(result["said"]) < 40
    assert all("\n" not in line for line in result["said"])
    assert result["found"] == []
    assert result["there"] == result["rows"] == 41


def test_writers_at_once_wait_for_each_other_and_nothing_is_lost_or_doubled(tmp_path: Path) -> None:
    result = attack(AT_ONCE, tmp_path / "store", 8)
    assert result["codes"] == [0, 0, 0]
    assert result["names"] == sorted(f"{writer}-{number}" for writer in range(3) for number in range(8))
    assert result["found"] == []
    assert result["read"] > 0
