"""The real motors of public recordings: their logs, bench and motor files, and what is known of them."""

from __future__ import annotations

import csv
import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

HERE = Path(__file__).parent
HUST = HERE.parent.parent / "examples" / "hust_motor"
SEVEN_NODES = HERE.parent.parent / "examples" / "hust_seven_nodes" / "bench.toml"
FOUR_NODES = HERE.parent.parent / "replay" / "templates" / "ipm_four_node.toml"
PART_S = 1800.0  # of a profile that is cut
SHORTEST = ("id_1", "id_9", "id_10")


@dataclass(frozen=True)
class Motor:
    """`logs`, each a session; the `bench` file, which names the motor file; the `law` that the motor file is known to
    lack, by the beginning of its id, None where nobody knows."""

    logs: Sequence[Path]
    bench: Path
    law: str | None


def motor_of(folder: Path, room: Path, quick: bool, seven: bool = False) -> Motor:
    """The motor whose recordings lie in a folder; what has to be written for it lies in `room`. `quick`: three of its
    sessions, short ones; `seven`: by the file of its seven nodes. Raises SystemExit where it has no such file."""
    profiles = sorted(folder.glob("profile_*.csv"))
    if profiles and seven:
        raise SystemExit(f"--seven is for the recordings id_*.csv, which {folder} does not hold: leave it out.")
    if profiles:
        logs = [part for profile in profiles for part in parts(profile, room)]
        for file in (HERE / "lea.toml", FOUR_NODES):
            shutil.copy(file, room)
        return Motor(logs[:3] if quick else logs, room / "lea.toml", None)
    logs = sorted(folder.glob("id_*.csv*"), key=lambda log: int(session_of(log).removeprefix("id_")))
    if quick:
        logs = [log for log in logs if session_of(log) in SHORTEST]
    if seven:  # its air gap has a term that grows with speed
        return Motor(logs, SEVEN_NODES, None)
    return Motor(logs, HUST / "bench.toml", "conductance.stator-rotor.speed")


def session_of(log: Path) -> str:
    """The name that a log's session has."""
    return log.name.split(".")[0]


def parts(profile: Path, room: Path) -> list[Path]:
    """A profile of LEA's motor, cut into sessions of about half an hour."""
    with profile.open(newline="") as text:
        head, *rows = csv.reader(text)
    at = head.index("t_s")
    length_s = float(rows[-1][at]) - float(rows[0][at])
    count = max(1, round(length_s / PART_S))
    number = profile.name.split("_")[1]
    found = []
    for part in range(count):
        own = rows[part * len(rows) // count : (part + 1) * len(rows) // count]
        found.append(room / f"profile_{number}_{part + 1}.csv")
        with found[-1].open("w", newline="") as text:
            csv.writer(text).writerows([head, *own])
    return found
