"""The tutorial is run as it stands, the complete files of the references are read, and refusals are worded as they
say. As a script it writes the tutorial's logs into a folder, for a reader who wants to follow it: python
tests/test_docs_run.py FOLDER; and plays a planned day in place of a bench: python tests/test_docs_run.py day.csv
"""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from pathlib import Path

import can
import cantools
import numpy as np
import pytest

from ingest.bench.bench_file import read_bench
from ingest.bench.resolving import check_nodes, refuse_unit_row, resolve
from ingest.bench.signals import Signal
from ingest.errors import IngestError
from made import can_bench, potted_servo
from made.places import ROOT
from replay.cli import main
from replay.engine.files.motor_file import read_motor
from replay.errors import ReplayError

DOCS = ROOT / "docs"
LEFT_OUT = "..."
PLAYED = "../.venv/bin/python ../tests/test_docs_run.py "  # a day, in place of a bench
MAGNET_W = 60.0  # at full speed; the motor file of the tutorial says 30
NOISE_K = 0.05
SECONDS, SHORT_S = 900, 360


def write_logs(folder: Path) -> None:
    """A morning on CAN with the power analyser's table beside it, and an afternoon in which a thermocouple comes
    off."""
    (folder / "bench.dbc").write_text(can_bench.DBC, encoding="utf-8")
    temperatures = _write_can(folder / "monday_am.blf", 1, can_bench.START)
    _write_power(folder / "monday_am_power.csv", 1, can_bench.START, temperatures)
    _write_can(folder / "monday_pm.asc", 2, can_bench.START + 7200, comes_off_at=600)
    write_tuesday(folder)


def write_tuesday(folder: Path) -> None:
    """Three short runs with the winding potted."""
    for number in range(3):
        speed, current = (values[::10] for values in can_bench.drive(SHORT_S, 10 + number))
        start = can_bench.START + 86_400 + 3600 * number
        _write_potted(folder / f"tuesday_{number + 1}.blf", speed, current, np.full(SHORT_S, 30.0), 10 + number, start)


def play(day: Path) -> Path:
    """The log of a planned day on the potted motor, beside its file."""
    log = day.with_name("thursday.blf")
    _write_potted(log, *potted_servo.set_values(day), seed=20, start=can_bench.START + 3 * 86_400)
    return log


def _write_potted(
    path: Path, speed: can_bench.Floats, current: can_bench.Floats, coolant: can_bench.Floats, seed: int, start: float
) -> None:
    """A log of the potted motor, everything at 1 Hz."""
    true = potted_servo.truth(speed, current, coolant, MAGNET_W)
    _log(path, start, speed, current, _read(np.column_stack([true, coolant]), seed), hz=1)


def _write_can(path: Path, seed: int, start: float, comes_off_at: int = SECONDS) -> can_bench.Floats:
    """Drive at 10 Hz, temperatures at 1 Hz, and a counter of which no database knows; the true temperatures."""
    speed, current = can_bench.drive(SECONDS, seed)
    true = can_bench.truth(speed, current, 30.0, MAGNET_W)
    read = _read(np.column_stack([true, np.full(len(true), 30.0)]), seed)
    read[comes_off_at:, 1] = read[comes_off_at, 1]
    _log(path, start, speed, current, read, hz=10)
    return true


def _read(true: can_bench.Floats, seed: int) -> can_bench.Floats:
    read: can_bench.Floats = true + np.random.default_rng(seed).normal(0.0, NOISE_K, true.shape)
    return read


def _log(
    path: Path, start: float, speed: can_bench.Floats, current: can_bench.Floats, read: can_bench.Floats, hz: int
) -> None:
    """Drive at so many Hz, the four thermocouples each second."""
    database = cantools.database.can.Database()
    database.add_dbc_string(can_bench.DBC)
    with can.Logger(path) as log:
        for k in range(len(speed)):
            drive = {"MotorSpeed": speed[k], "MotorTorque": 0.8 * current[k], "PhaseCurrent": current[k]}
            frames = [(256, database.encode_message("Drive", drive, strict=False))]
            if k % hz == 0:
                names = ("TC_winding", "TC_yoke", "TC_magnet", "TC_coolant")
                temps = dict(zip(names, read[k // hz], strict=True))
                frames += [(512, database.encode_message("Temps", temps, strict=False)), (768, bytes([k // hz % 256]))]
            for number, data in frames:
                log.on_message_received(
                    can.Message(
                        timestamp=start + k / hz, arbitration_id=number, is_extended_id=False, data=data, channel=0
                    )
                )


def _write_power(path: Path, seed: int, start: float, temperatures: can_bench.Floats) -> None:
    """Electrical power [kW] at 1 Hz, 5 s late, as an analyser with continental settings exports it."""
    speed, current = (values[::10] for values in can_bench.drive(SECONDS, seed))
    copper = 240.0 * (current / 20.0) ** 2 * (1 + can_bench.ALPHA * (temperatures[:-1, 0] - 20.0))
    iron = 90.0 * (speed / 6000.0) ** 1.5 + MAGNET_W * (speed / 6000.0) ** 2
    watts = 0.8 * current * speed * np.pi / 30.0 + copper + iron
    rows = ["Time;P_el", ";kW"]
    for second in range(5, SECONDS):
        stamp = datetime.fromtimestamp(start + second, UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
        rows.append(f"{stamp};{watts[second] / 1000:.4f}".replace(".", ","))
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")


def test_the_tutorial_goes_as_it_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("WHYHOT_STORE", raising=False)
    write_logs(tmp_path)
    page = (DOCS / "tutorial.md").read_text(encoding="utf-8")
    ran = 0
    for kind, name, block in _blocks(page):
        assert kind in ("toml", "console"), f"a block of {kind} is not tested"
        if kind == "toml":
            (tmp_path / name).write_text(block, encoding="utf-8")
            continue
        for command, shown in _commands(block):
            assert _run(command) == 0, command
            _assert_printed(shown, capsys.readouterr().out, command)
            ran += 1
    assert ran > 10


def test_a_damaged_store_is_brought_back_as_the_page_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copytree(ROOT / "examples" / "hidden_effect", tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("WHYHOT_STORE", raising=False)
    page = (DOCS / "damage.md").read_text(encoding="utf-8")
    codes = []
    for _, _, block in _blocks(page):
        for command, shown in _commands(block):
            codes.append(_run(command))
            said = capsys.readouterr()
            _assert_printed(shown, said.err + said.out, command)
    assert [code for code in codes if code] == [1, 1, 2], "a damaged file, a changed event, and a verb that reads it"
    assert len(codes) > 15


@pytest.mark.parametrize(("page", "reads"), [("bench_file.md", read_bench), ("motor_file.md", read_motor)])
def test_complete_files_of_a_reference_are_read(page: str, reads: Callable[[bytes, str], object]) -> None:
    text = (DOCS / page).read_text(encoding="utf-8")
    whole = [block for kind, _, block in _blocks(text) if kind == "toml" and block.startswith("schema =")]
    assert len(whole) > 1
    for block in whole:
        reads(block.encode(), page)


ENTRY = '[[channel]]\nsignal = "MAG_1"\nquantity = "temperature"\n'
LUMP = 'name = "m"\n[[node]]\nname = "winding"\ncapacity = 1.0\n[[boundary]]\nname = "c"\n'
LINK = '[[link]]\nbetween = ["winding", "c"]\nterms = [{coefficient = 1.0'


def _meets_a_log(data: bytes, name: str) -> None:
    log = [Signal("T", bus=bus, message=m) for bus, m in (("can1", "A"), ("can1", "B"), ("can2", "A"))]
    log += [Signal("EW_A_3v", "TempA", source="bench.dbc"), Signal("MAG_1"), Signal("n")]
    bench = read_bench(data, name)
    check_nodes(bench, ["magnet"], ["coolant"])
    resolve(bench, log)
    refuse_unit_row(bench, {"n": "rad/s"}, "tue.csv")


@pytest.mark.parametrize(
    ("reads", "text"),
    [
        (read_bench, f'{ENTRY}unit = "K"\nnod = "a"'),
        (read_bench, f'{ENTRY}unit = "bar"'),
        (read_bench, ENTRY.replace("temperature", "current") + 'unit = "Apk"'),
        (_meets_a_log, ENTRY.replace("MAG_1", "T") + 'unit = "K"'),
        (_meets_a_log, "\n\n" + ENTRY.replace("MAG_1", "EW_A_3V") + 'unit = "K"'),
        (_meets_a_log, f'{ENTRY}unit = "K"\nnode = "magnt"'),
        (_meets_a_log, f'{ENTRY}unit = "K"\nweights = {{magnet = 0.9, coolant = 0.1}}'),
        (_meets_a_log, ENTRY.replace("MAG_1", "n").replace("temperature", "speed") + 'unit = "rpm"'),
        (read_motor, f"{LUMP}{LINK}, speeed = 1}}]"),
        (read_motor, f"{LUMP}{LINK}, speed = 1}}]"),
        (read_motor, LUMP),
        (read_motor, f"{LUMP}{LINK}}}]\n" + LINK.replace('"winding", "c"', '"c", "winding"') + "}]"),
        (read_motor, f'{LUMP}[[circuit]]\nname = "jacket"'),
    ],
)
def test_refusals_are_worded_as_on_the_page(reads: Callable[[bytes, str], object], text: str) -> None:
    name = "motor" if reads is read_motor else "bench"
    with pytest.raises((IngestError, ReplayError)) as caught:
        reads(text.encode(), f"{name}.toml")
    page = (DOCS / f"{name}_file.md").read_text(encoding="utf-8")
    quoted = re.findall(rf"^\| `({name}\.toml:[^`]*)`", page, flags=re.MULTILINE)
    says = str(caught.value)
    assert any(says.startswith(q[:-4]) if q.endswith(" ...") else says == q for q in quoted), says


@pytest.mark.parametrize("page", sorted(DOCS.glob("*.md")), ids=lambda page: page.name)
def test_links_to_headings_find_them(page: Path) -> None:
    for target, heading in re.findall(r"\]\(([\w/]*\.?\w*)#([\w-]+)\)", page.read_text(encoding="utf-8")):
        text = (page.parent / target if target else page).read_text(encoding="utf-8")
        titles = [re.sub(r"[^\w -]", "", title.lower()) for title in re.findall(r"^#+ (.+)$", text, flags=re.MULTILINE)]
        assert heading in [title.replace(" ", "-") for title in titles], f"{target}#{heading}"


def _blocks(page: str) -> Iterator[tuple[str, str, str]]:
    """(kind, last `file.toml` named before it, text) of each fenced block, in the order of the page."""
    for found in re.finditer(r"^```(\w+)\n(.*?)^```$", page, flags=re.MULTILINE | re.DOTALL):
        names = re.findall(r"`(\w+\.toml)`", page[: found.start()])
        yield found[1], names[-1] if names else "", found[2]


def _commands(block: str) -> Iterator[tuple[str, list[str]]]:
    """Each command behind `$ `, over several lines where a quote is open, and the lines that are shown of its
    answer."""
    for text in re.split(r"^\$ ", block, flags=re.MULTILINE)[1:]:
        lines = text.rstrip("\n").split("\n")
        end = 1
        while "\n".join(lines[:end]).count('"') % 2:
            end += 1
        yield "\n".join(lines[:end]), lines[end:]


def _run(command: str) -> int:
    if command.startswith(PLAYED):
        print(play(Path(shlex.split(command)[-1])))
        return 0
    if command.startswith("whyhot "):
        return main(shlex.split(command)[1:])
    other = subprocess.run(command, shell=True, check=False, stdout=subprocess.PIPE, text=True)
    print(other.stdout)
    return other.returncode


def _assert_printed(shown: list[str], printed: str, command: str) -> None:
    """Every line shown was printed, in this order, but for the number of blanks; one that ends in ... as a
    beginning, one that begins with it as an end."""
    rest = iter([_plain(line) for line in printed.splitlines()])
    for line in shown:
        wanted = _plain(line)
        if wanted != LEFT_OUT:
            found = any(_is_shown(one, wanted) for one in rest)
            assert found, f"{command}\ndid not print, after the lines before it: {line}\nbut:\n{printed}"


def _is_shown(printed: str, wanted: str) -> bool:
    if wanted.endswith(LEFT_OUT):
        return printed.startswith(wanted.removesuffix(LEFT_OUT).rstrip())
    return printed.endswith(wanted.removeprefix(LEFT_OUT)) if wanted.startswith(LEFT_OUT) else printed == wanted


def _plain(line: str) -> str:
    return " ".join(line.split())


if __name__ == "__main__":
    given = Path(sys.argv[1])
    if given.suffix == ".csv":
        print(play(given))
    else:
        given.mkdir(exist_ok=True)
        write_logs(given)
