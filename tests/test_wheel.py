"""The wheel, built and installed into an empty environment without rerun, does the whole demo from an empty folder."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from ingest.errors import WITH_EXTRAS
from made.browser import faults, label_faults, printed_pages
from made.places import ROOT

RECORDINGS = (0, 1, 2, 3, 4, 6, 7, 9, 10, 12, 14)


def _run(*words: str | Path, cwd: Path, env: dict[str, str] | None = None) -> subprocess.CompletedProcess[str]:
    done = subprocess.run([str(w) for w in words], cwd=cwd, env=env, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{words}\n{done.stdout[-3000:]}\n{done.stderr[-3000:]}"
    return done


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    _run(sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", folder, ROOT, cwd=folder)
    (built,) = folder.glob("*.whl")
    return built


@pytest.fixture(scope="module")
def installed(wheel: Path) -> Path:
    """The folder of programs of an environment that holds the wheel and what it needs, nothing else."""
    environment = wheel.parent / "env"
    _run(sys.executable, "-m", "venv", environment, cwd=wheel.parent)
    python = environment / ("Scripts" if os.name == "nt" else "bin") / "python"
    uv = shutil.which("uv")
    install: list[str | Path] = (
        [uv, "pip", "install", "-q", "--python", python]
        if uv
        else [python, "-m", "pip", "install", "-q", "--no-compile"]
    )
    pinned = re.findall(r"^\w.*?==.*?(?= \\$)", (ROOT / "requirements.lock").read_text(encoding="utf-8"), re.MULTILINE)
    (wheel.parent / "versions").write_text("\n".join(pinned))  # with hashes pip would ask for one of the wheel too
    _run(*install, wheel, "-c", wheel.parent / "versions", cwd=wheel.parent)
    _bring_what_is_compiled(next(environment.rglob("twin/__init__.py")).parent)
    return python.parent


def _bring_what_is_compiled(twin: Path) -> None:
    """What numba compiled of the checkout's sources, beside the same sources as installed: it goes by their times. What
    is missing is compiled as ever."""
    for source in twin.rglob("*.py"):
        ours = ROOT / "twin" / source.relative_to(twin)
        assert source.read_bytes() == ours.read_bytes()
        shutil.copystat(ours, source)
        (source.parent / "__pycache__").mkdir(exist_ok=True)
        for compiled in (ours.parent / "__pycache__").glob(f"{ours.stem}.*.nb?"):
            shutil.copy(compiled, source.parent / "__pycache__")


def test_every_source_and_data_file_is_in_the_wheel(wheel: Path) -> None:
    inside = set(zipfile.ZipFile(wheel).namelist())
    packages = ("ingest", "twin", "analytics", "replay", "whyhot", "examples")
    listed = [name for name in _run("git", "ls-files", *packages, cwd=ROOT).stdout.split() if (ROOT / name).exists()]
    assert len(listed) > 50
    assert not {f"replay/{name}" if name.startswith("examples/") else name for name in listed} - inside
    assert "replay/examples/hust_motor/id_3.csv.gz" in inside
    shipped = {path.name for path in (ROOT / "notebooks").glob("*.py")} - {"paper.py"}  # which runs on the tests' plant
    assert {name for name in inside if name.startswith("replay/notebooks/")} == {
        f"replay/notebooks/{n}" for n in shipped
    }


def test_help_and_demo_work_from_an_empty_folder(installed: Path, tmp_path: Path) -> None:
    whyhot = installed / "whyhot"
    env = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "WHYHOT_STORE")}
    assert "demo" in _run(whyhot, "--help", cwd=tmp_path, env=env).stdout
    missing = subprocess.run([installed / "python", "-c", "import rerun"], capture_output=True, check=False)
    assert missing.returncode != 0, "rerun is left out on purpose"
    done = _run(whyhot, "demo", "--json", "answer.json", cwd=tmp_path, env=env)
    assert "demo/report.html" in done.stdout
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert WITH_EXTRAS in done.stderr and WITH_EXTRAS in readme
    quoted = re.findall(r"^```\n((?:Ingested|Answer|Batch) .*?)^```$", readme, flags=re.MULTILINE | re.DOTALL)
    real, why, *simulated = (block.splitlines() for block in quoted)
    assert len(real) > 4 and [block[0].split()[1] for block in simulated] == ["The", "2", "specimens"]
    printed = done.stdout.splitlines()
    assert not [line for line in real if line not in printed], "README quotes what the demo prints"
    at = [line.startswith("And a campaign") for line in printed].index(True)
    first, second = printed[:at], printed[at:]
    assert any("conductance.stator-rotor.speed" in line for line in why) and _not_printed(why, first) == []
    for block in simulated:
        assert _not_printed(block, second) == []
    shown, drawn = (_texts(path) for path in (ROOT / "docs" / "demo.svg", tmp_path / "demo" / "why.svg"))
    assert len(shown) > 20 and _not_printed(shown, drawn) == [], "docs/demo.svg is what the demo draws"
    reported = _texts(tmp_path / "demo" / "why_real_motor.html")
    for picture in ("real_motor_chain", "real_motor_law"):
        shown = _texts(ROOT / "docs" / f"{picture}.svg")
        assert len(shown) > 10 and _not_printed(shown, reported) == [], f"docs/{picture}.svg is of the demo's report"
    answer = json.loads((tmp_path / "answer.json").read_text(encoding="utf-8"))
    assert [run["session_name"] for run in answer["runs"]] == [f"id_{number}" for number in RECORDINGS]
    assert (tmp_path / "demo" / "report.html").stat().st_size > 100_000
    for name in ("report", "why", "why_real_motor"):
        assert printed_pages(tmp_path / "demo" / f"{name}.html") < 16
    assert _run(whyhot, "notebook", cwd=tmp_path, env=env).stdout.startswith("campaign ")
    _run(whyhot, "sql", "SELECT count(*) FROM samples", "--store", "demo/store", cwd=tmp_path, env=env)
    pages = sorted((tmp_path / "demo").glob("*.html"))
    assert len(pages) == 5 and [(page.name, fault) for page in pages for fault in faults(page)] == []
    pictures = sorted((tmp_path / "demo").glob("*.svg"))
    assert len(pictures) == 3 and [(one.name, fault) for one in pictures for fault in label_faults(one)] == []


def test_a_quoted_line_must_be_printed_word_by_word_and_number_by_number() -> None:
    printed = ["Named cause  loss.magnet.speed2   probability 98 % (ln BF 35.6)", "  +21.7 W/K (17.3 to 26.2)"]
    assert _not_printed(printed, ["What is wrong", *printed]) == []
    assert _not_printed(printed[1:], ["+21.6 W/K (17.3 to 26.3)"]) == [], "another processor rounds otherwise"
    assert _not_printed(printed[1:], ["+23.0 W/K (17.3 to 26.2)"]) == printed[1:]
    assert _not_printed(printed[:1], [printed[0].replace("speed2", "speed1.5")]) == printed[:1]
    assert _not_printed(printed, printed[::-1]) == printed[1:], "in another order"


def _texts(picture: Path) -> list[str]:
    """What is written in a picture."""
    return re.findall(r">([^<>]+)</text>", picture.read_text(encoding="utf-8"))


NUMBER = r"(?<![\w.])\d[\d,]*(?:\.\d+)?(?![\w.]*\w)"  # not those in an id, a clock or a name


def _not_printed(quoted: list[str], printed: list[str]) -> list[str]:
    """The quoted lines that do not come in `printed` in this order, blanks aside: words equal, numbers to within 2 %
    or one in the last digit, as far as processors may differ."""
    rest, lost = iter(printed), []
    for line in quoted:
        if not any(_alike(line, other) for other in rest):
            lost.append(line)
            rest = iter(printed)
    return lost


def _alike(quoted: str, printed: str) -> bool:
    if re.sub(NUMBER, "#", quoted).split() != re.sub(NUMBER, "#", printed).split():
        return False
    numbers = zip(re.findall(NUMBER, quoted), re.findall(NUMBER, printed), strict=True)
    return all(_near(a.replace(",", ""), b.replace(",", "")) for a, b in numbers)


def _near(quoted: str, printed: str) -> bool:
    last_digit = 10.0 ** -len(quoted.partition(".")[2])
    return abs(float(quoted) - float(printed)) <= max(0.02 * float(quoted), 1.01 * last_digit)


def test_a_module_that_hides_ours_is_named(installed: Path, tmp_path: Path) -> None:
    (tmp_path / "analytics.py").write_text("", encoding="utf-8")
    done = subprocess.run(
        [installed / "python", "-c", "import whyhot"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode != 0
    assert "hides whyhot's package 'analytics'" in done.stderr
