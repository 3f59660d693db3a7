"""A session of which only a part can be replayed: which, and why, is said where the replay is printed."""

from __future__ import annotations

from pathlib import Path

import pytest

from made.places import ROOT
from replay.cli import main

CHANNELS = {"n": ("speed", "rpm", ""), "I": ("current", "A", ""), "T_w": ("temperature", "degC", "winding")}
CHANNELS |= {f"T_{node}": ("temperature", "degC", node) for node in ("coolant", "ambient")}


def test_what_is_replayed_of_a_session_with_a_long_silence_is_said_with_where_times_begin(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    times = [*range(0, 300, 10), *range(1200, 2100, 10)]
    rows = [f"{t},3000,{100 + t % 30},{60 + t / 100:.1f},{60 + t % 20 / 100},{25 + t % 40 / 100}" for t in times]
    (tmp_path / "day.csv").write_text("\n".join([",".join(["t", *CHANNELS]), *rows]))
    motor = (ROOT / "replay" / "templates" / "three_node.toml").read_text(encoding="utf-8")
    (tmp_path / "motor.toml").write_text(motor, encoding="utf-8")
    bench = ['motor = "motor.toml"', '[time]\ncolumn = "t"\nunit = "s"']
    for name, (quantity, unit, node) in CHANNELS.items():
        place = f'node = "{node}"' if node else ""
        bench.append(f'[[channel]]\nsignal = "{name}"\nquantity = "{quantity}"\nunit = "{unit}"\n{place}')
    (tmp_path / "bench.toml").write_text("\n".join(bench), encoding="utf-8")
    store = ["--store", str(tmp_path / "s")]
    assert main(["ingest", str(tmp_path / "day.csv"), "--bench", str(tmp_path / "bench.toml"), *store]) == 0
    assert main(["replay", "day", *store]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "Left out day: 0:20:00 to 0:34:50 of 0:34:50 replayed: elsewhere inputs are silent for more than" in said
    assert "; times count from 0:20:00" in said
