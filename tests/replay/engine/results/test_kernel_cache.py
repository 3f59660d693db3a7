from __future__ import annotations

import pickle
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numba
import numpy as np
import pytest

from replay.engine.results import kernel_cache
from replay.engine.results.kernel_cache import load, load_kernel
from twin.compiled.kernel import Compiled, generate
from twin.motor.network import Boundary, Link, Network, Node, Source, Term
from twin.run.simulate import Frame, simulate

LUMP = Network(
    name="lump",
    nodes=(Node("winding", 100.0, "copper"),),
    boundaries=(Boundary("coolant"),),
    links=(Link("winding", "coolant", (Term(2.0),)),),
    sources=(Source("winding", (Term(50.0, {"current": 2.0}),)),),
    scale={"current": 100.0},
)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    monkeypatch.setenv("WHYHOT_CACHE", str(tmp_path))
    load.cache_clear()
    yield tmp_path / "kernels"
    load.cache_clear()


def _last(compiled: Compiled) -> float:
    inputs = Frame(1.0, np.ones((1000, 1)), np.full((1000, 1), 20.0))
    return float(simulate(compiled, inputs, np.array([20.0]))[-1, 0])


def _hits(source: str) -> int:
    """Kernels that a new process takes from the cache instead of compiling."""
    code = (
        "import sys; from replay.engine.results.kernel_cache import load; "
        "run = load(sys.stdin.read()); print(sum(run.stats.cache_hits.values()))"
    )
    done = subprocess.run([sys.executable, "-c", code], input=source, capture_output=True, text=True, check=True)
    return int(done.stdout)


def test_a_kernel_is_kept_by_its_content_and_a_later_start_compiles_nothing(folder: Path) -> None:
    assert _last(load_kernel(LUMP)) == pytest.approx(45.0)
    (module,) = folder.glob("*.py")
    assert module.stem.startswith("kernel_")
    assert not list(folder.glob("*.tmp"))
    assert _hits(generate(LUMP)) == 1


def test_a_kernel_that_is_compiled_at_its_first_call_is_kept_as_well(folder: Path) -> None:
    source = "import numba\n\n\n@numba.njit(cache=CACHE)\ndef run(x):\n    return 2 * x\n"
    assert load(source)(21) == 42
    code = (
        "import sys; from replay.engine.results.kernel_cache import load; "
        "run = load(sys.stdin.read()); run(21); print(sum(run.stats.cache_hits.values()))"
    )
    done = subprocess.run([sys.executable, "-c", code], input=source, capture_output=True, text=True, check=True)
    assert int(done.stdout) == 1


def test_the_same_topology_is_loaded_once_a_process(folder: Path) -> None:
    source = generate(LUMP)
    assert load(source) is load(source)


def test_a_damaged_module_is_written_anew(folder: Path) -> None:
    load_kernel(LUMP)
    (module,) = folder.glob("*.py")
    whole = module.read_text()
    module.write_text("import nothing_at_all\n")
    load.cache_clear()
    assert _last(load_kernel(LUMP)) == pytest.approx(45.0)
    assert module.read_text() == whole


def test_damaged_machine_code_is_compiled_again(folder: Path) -> None:
    load_kernel(LUMP)
    for data in (folder / "__pycache__").glob("*.nbc"):
        data.write_bytes(data.read_bytes()[:100])
    load.cache_clear()
    assert _last(load_kernel(LUMP)) == pytest.approx(45.0)


def test_changed_machine_code_is_compiled_again_not_run(folder: Path) -> None:
    load_kernel(LUMP)
    (data,) = (folder / "__pycache__").glob("*.nbc")
    whole = data.read_bytes()
    data.write_bytes(whole[: len(whole) // 2] + bytes([whole[len(whole) // 2] ^ 1]) + whole[len(whole) // 2 + 1 :])
    load.cache_clear()
    assert _last(load_kernel(LUMP)) == pytest.approx(45.0)
    assert _hits(generate(LUMP)) == 1


def test_a_pickle_that_was_put_in_is_never_loaded(folder: Path) -> None:
    load_kernel(LUMP)
    (index,) = (folder / "__pycache__").glob("*.nbi")
    index.write_bytes(pickle.dumps(numba.__version__) + pickle.dumps(_Trap(folder / "sprung")))
    load.cache_clear()
    assert _last(load_kernel(LUMP)) == pytest.approx(45.0)
    assert not (folder / "sprung").exists()


class _Trap:
    """Makes a file as it is unpickled."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[object, ...]:
        return Path.touch, (self.path,)


@pytest.mark.skipif(sys.platform == "win32", reason="rights are not in the mode there")
@pytest.mark.parametrize("inside", ["", "__pycache__"])
def test_a_folder_that_others_may_write_is_done_without_in_one_line(
    folder: Path, caplog: pytest.LogCaptureFixture, inside: str
) -> None:
    (folder / inside).mkdir(parents=True)
    (folder / inside).chmod(0o777)
    for _ in range(2):
        load.cache_clear()
        assert _last(load_kernel(LUMP)) == pytest.approx(45.0)
    (record,) = caplog.records
    assert record.getMessage() == (
        f"{folder}: others may write in it: kernels are compiled anew at every start. Name another folder with "
        "WHYHOT_CACHE."
    )
    assert not list(folder.glob("*.py"))


def test_a_folder_that_cannot_be_written_is_done_without(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("not a folder")
    monkeypatch.setenv("WHYHOT_CACHE", str(tmp_path / "file"))
    load.cache_clear()
    assert _last(load_kernel(LUMP)) == pytest.approx(45.0)
    load.cache_clear()


def test_the_folder_follows_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("WHYHOT_CACHE", "/a")
    assert kernel_cache.folder() == Path("/a/kernels")
    monkeypatch.delenv("WHYHOT_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", "/b")
    assert kernel_cache.folder() == Path("/b/whyhot/kernels")
    monkeypatch.delenv("XDG_CACHE_HOME")
    assert kernel_cache.folder() == Path.home() / ".cache/whyhot/kernels"
