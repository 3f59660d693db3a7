"""The shape of the house: who may import whom, how light the front door is, and that pages and version agree."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
MAY_IMPORT = {
    "twin": {"twin"},
    "ingest": {"ingest"},
    "analytics": {"analytics", "ingest"},
    "replay": {"replay", "twin", "ingest", "analytics", "whyhot"},
    "whyhot": {"whyhot", "ingest", "twin", "analytics", "replay"},
}
OURS = set(MAY_IMPORT)


def _imports(tree: ast.AST) -> set[str]:
    names: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names.add(node.module.split(".")[0])
    return names


def _modules(package: str) -> list[Path]:
    return sorted((ROOT / package).rglob("*.py"))


@pytest.mark.parametrize("package", sorted(MAY_IMPORT))
def test_imports_go_one_way(package: str) -> None:
    modules = _modules(package)
    assert modules
    for path in modules:
        strays = (_imports(ast.parse(path.read_text(encoding="utf-8"))) & OURS) - MAY_IMPORT[package]
        assert not strays, f"{path.relative_to(ROOT)} imports {sorted(strays)}"


def test_replay_imports_analytics_only_inside_functions() -> None:
    for path in _modules("replay"):
        module = ast.parse(path.read_text(encoding="utf-8"))
        at_the_top = [_imports(node) for node in module.body if isinstance(node, ast.Import | ast.ImportFrom)]
        assert "analytics" not in set().union(*at_the_top), path.relative_to(ROOT)


def test_the_twin_touches_no_file_clock_or_screen() -> None:
    shell = {"pathlib", "os", "io", "time", "datetime", "logging", "tomllib", "json", "pyarrow", "duckdb"}
    for path in _modules("twin"):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        assert not _imports(tree) & shell, path.relative_to(ROOT)
        called = {n.func.id for n in ast.walk(tree) if isinstance(n, ast.Call) and isinstance(n.func, ast.Name)}
        assert not called & {"print", "open"}, path.relative_to(ROOT)


def test_help_imports_nothing_heavy() -> None:
    code = (
        "import sys; from replay.cli import main\n"
        "try: main(['--help'])\n"
        "except SystemExit: pass\n"
        "heavy = {'numpy', 'pyarrow', 'duckdb', 'numba', 'matplotlib', 'rerun', 'pint', 'cantools'} & set(sys.modules)\n"
        "assert not heavy, heavy"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_changelog_begins_with_the_version() -> None:
    from whyhot import __version__

    changelog = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert next(line for line in changelog.splitlines() if line.startswith("## ")).startswith(f"## {__version__}")
    assert f'version = "{__version__}"' in (ROOT / "pyproject.toml").read_text(encoding="utf-8")


def test_locks_name_versions_and_no_index() -> None:
    for lock in ("requirements.lock", "requirements-bench.lock"):
        text = (ROOT / lock).read_text(encoding="utf-8")
        assert "==" in text
        assert "://" not in text
        assert "index" not in text
