"""One minute of one motor as MDF 4, MDF 3 and MCAP: ingested with one bench file, the same samples of each."""

import json
import struct
from collections.abc import Callable
from pathlib import Path

import pytest
from mcap.writer import Writer

from made import mdf, mdf3
from replay.cli import main

START_NS = 1_700_000_000_000_000_000
BENCH = """schema = "whyhot.bench/1"
[[channel]]
signal = "T_winding"
quantity = "temperature"
unit = "degC"
[[channel]]
signal = "n"
quantity = "speed"
unit = "rpm"
"""
FAST = [(i / 10, 200 + i) for i in range(600)]  # s, temperature in steps of 0.1 degC
SLOW = [(float(i), 1000 + 10 * i) for i in range(60)]  # s, speed


def as_mdf4(path: Path) -> Path:
    file = mdf.Mdf4()
    fast, slow = (b"".join(struct.pack("<dh", *row) for row in rows) for rows in (FAST, SLOW))
    law = file.conversion(mdf.LINEAR, (0, 0.1), unit="degC")
    speed = file.stored("slow", (mdf.SECONDS, mdf.Channel("n", mdf.SIGNED, 8, 16)), slow, 10)
    winding = mdf.Channel("T_winding", mdf.SIGNED, 8, 16, law=law)
    group = file.stored("fast", (mdf.SECONDS, winding), fast, 10, after=speed)
    return file.save(path, group, start_ns=START_NS)


def as_mdf3(path: Path) -> Path:
    file = mdf3.Mdf3File()
    fast, slow = (b"".join(struct.pack("<dh", *row) for row in rows) for rows in (FAST, SLOW))
    law = file.law(0, 2, file.numbers(0, 0.1), "degC")
    some = (mdf3.SECONDS, mdf3.Channel3("n", mdf3.SIGNED, 64, 16))
    speed = file.data_group(file.group("slow", some, len(SLOW), 10), slow)
    winding = (mdf3.SECONDS, mdf3.Channel3("T_winding", mdf3.SIGNED, 64, 16, law=law))
    group = file.data_group(file.group("fast", winding, len(FAST), 10), fast, after=speed)
    return file.save(path, group, start=(START_NS, 0))


def as_mcap(path: Path) -> Path:
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start("", "test")
        for topic, name, rows, scale in (("a", "T_winding", FAST, 0.1), ("b", "n", SLOW, 1)):
            channel = writer.register_channel(topic, "json", 0)
            for t, raw in rows:
                stamp, value = START_NS + round(t * 1e9), scale * raw
                writer.add_message(channel, stamp, json.dumps({name: value}).encode(), publish_time=stamp)
        writer.finish()  # type: ignore[no-untyped-call]
    return path


@pytest.mark.parametrize("made", [as_mdf4, as_mdf3, as_mcap], ids=lambda one: one.__name__)
def test_a_minute_gives_the_same_samples_in_every_format(
    made: Callable[[Path], Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Samples of two groups at ten hertz and one; none twice, none missing, no clock that steps back."""
    names = {"T_winding": "a.T_winding", "n": "b.n"} if made is as_mcap else {}
    text = BENCH
    for name, topic in names.items():
        text = text.replace(f'"{name}"', f'"{topic}"')
    (tmp_path / "bench.toml").write_text(text, encoding="utf-8")
    log, store = made(tmp_path / "log"), ["--store", str(tmp_path / "store")]
    assert main(["ingest", str(log), "--bench", str(tmp_path / "bench.toml"), *store]) == 0
    said = capsys.readouterr()
    assert "decoded 600 · unknown id 0 · wrong length 0 · rejected 0 = 600 in the file" in said.out
    assert "clock" not in said.out and "stamp" not in said.out
    query = "SELECT quantity, t_ns, value FROM samples WHERE value IS NOT NULL ORDER BY ALL"
    assert main(["sql", query, "--json", *store]) == 0
    rows = [tuple(row.values()) for row in json.loads(capsys.readouterr().out)["rows"]]
    speeds = [value for quantity, _, value in rows if quantity == "speed"]
    assert speeds == [float(raw) for _, raw in SLOW]
    temperatures = [(t_ns - START_NS, value) for quantity, t_ns, value in rows if quantity == "temperature"]
    assert [t for t, _ in temperatures] == [round(t * 1e9) for t, _ in FAST]
    assert [value for _, value in temperatures] == pytest.approx([0.1 * raw for _, raw in FAST])
