"""The shape of the house: who may import whom, how light the front door is, and that pages and version agree."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

from made.places import ROOT
from made.rooms import FOLDERS, ROOMS, docstring, module_name
from replay.engine.runs.sources import imported

MAY_IMPORT = {
    "twin": {"twin"},
    "ingest": {"ingest"},
    "analytics": {"analytics", "ingest"},
    "replay": {"replay", "twin", "ingest", "analytics", "whyhot"},
    "whyhot": {"whyhot", "ingest", "twin", "analytics", "replay"},
}
OURS = set(MAY_IMPORT)


@dataclass(frozen=True)
class Source:
    """What a file's text says: what it `defines` at its top, less what a decorator registers; its public `classes`;
    what it `imports` anywhere as (module, name, what it is called here), name "" for a whole module; the packages that
    it imports `at_the_top`; the names that it `loads`, and the (name, attribute) that it `asks`."""

    defines: set[str]
    classes: set[str]
    imports: set[tuple[str, str, str]]
    at_the_top: set[str]
    loads: set[str]
    asks: set[tuple[str, str]]

    def packages(self) -> set[str]:
        return {module.partition(".")[0] for module, _, _ in self.imports}

    def used(self, name: str) -> set[tuple[str, str]]:
        """(module, name) of all that the module of this name uses, of itself and of others."""
        modules = {called: f"{module}.{own}" for module, own, called in self.imports}
        asked = {(modules[of], attribute) for of, attribute in self.asks if of in modules}
        return {(name, own) for own in self.loads} | {(module, own) for module, own, _ in self.imports} | asked


@cache
def _read(path: Path) -> Source:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    found = Source(set(), set(), set(), set(), set(), set())
    for node in tree.body:
        found.at_the_top.update(module.partition(".")[0] for module, _, _ in _imports(node))
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            found.classes.add(node.name)
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.decorator_list:
            found.defines.add(node.name)
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            found.defines.update(target.id for target in targets if isinstance(target, ast.Name))
    for each in ast.walk(tree):
        if isinstance(each, ast.Name):
            found.loads.update([each.id] if isinstance(each.ctx, ast.Load) else [])
        elif isinstance(each, ast.Attribute):
            found.asks.update([(each.value.id, each.attr)] if isinstance(each.value, ast.Name) else [])
        else:
            found.imports.update(_imports(each))
    return found


def _imports(node: ast.AST) -> Iterator[tuple[str, str, str]]:
    if isinstance(node, ast.Import):
        yield from ((alias.name, "", alias.asname or alias.name) for alias in node.names)
    elif isinstance(node, ast.ImportFrom) and node.module:
        yield from ((node.module, alias.name, alias.asname or alias.name) for alias in node.names)


def _modules(package: str) -> list[Path]:
    return sorted((ROOT / package).rglob("*.py"))


@pytest.mark.parametrize("package", sorted(MAY_IMPORT))
def test_imports_go_one_way(package: str) -> None:
    modules = _modules(package)
    assert modules
    for path in modules:
        strays = (_read(path).packages() & OURS) - MAY_IMPORT[package]
        assert not strays, f"{path.relative_to(ROOT)} imports {sorted(strays)}"


def test_replay_imports_analytics_only_inside_functions() -> None:
    for path in _modules("replay"):
        assert "analytics" not in _read(path).at_the_top, path.relative_to(ROOT)


# What lies in no room of its folder.
OUTSIDE = {
    "ingest": {"errors"},
    "twin": {"errors"},
    "replay": {"errors", "shipped", "written"},
    "analytics.insulation": {"arrays", "campaign"},
}


MODULES = {module_name(path): path for package in MAY_IMPORT for path in _modules(package)}


def _imported(path: Path) -> set[str]:
    """Our modules that a module imports anywhere in its text, for the sake of a type too."""
    found = {f"{module}.{name}" if f"{module}.{name}" in MODULES else module for module, name, _ in _read(path).imports}
    return found & set(MODULES)


@cache
def graph() -> dict[str, set[str]]:
    """Module -> those of ours that it imports."""
    return {name: _imported(path) - {name} for name, path in MODULES.items()}


@pytest.mark.parametrize("house", sorted(ROOMS))
def test_a_room_imports_from_those_below_it_only(house: str) -> None:
    floor = {f"{house}.{room}": height for height, room in enumerate(ROOMS[house])}

    def room_of(module: str) -> str:
        return ".".join(module.split(".")[: house.count(".") + 2])

    strays = {room_of(module) for module in MODULES if module.startswith(f"{house}.")} - set(floor)
    assert strays == {f"{house}.{name}" for name in OUTSIDE.get(house, set())}, "each module lies in a room"
    up = [
        f"{module} imports {other}"
        for module, others in graph().items()
        for other in others
        if floor.get(room_of(module), len(floor)) < floor.get(room_of(other), -1)
    ]
    assert not up


def test_a_public_class_name_has_one_meaning() -> None:
    found: dict[str, list[str]] = {}
    for module, path in MODULES.items():
        for name in _read(path).classes:
            found.setdefault(name, []).append(module)
    assert {name: modules for name, modules in found.items() if len(modules) > 1} == {}


def test_no_files_import_each_other_in_a_circle() -> None:
    try:
        TopologicalSorter(graph()).prepare()
    except CycleError as circle:
        pytest.fail(" -> ".join(circle.args[1]))


@pytest.mark.parametrize("folder", FOLDERS, ids=module_name)
def test_a_folder_says_in_a_sentence_what_it_holds_and_runs_nothing(folder: Path) -> None:
    assert docstring(folder).splitlines()[0].endswith((".", "?"))
    tree = ast.parse((folder / "__init__.py").read_text(encoding="utf-8"))
    if module_name(folder) not in ("ingest.formats", "replay.cli"):  # the list of formats, the verbs
        assert len(tree.body) == 1, "holds more than its sentence"


@pytest.mark.parametrize("folder", FOLDERS, ids=module_name)
def test_a_folder_speaks_of_what_lies_in_it(folder: Path) -> None:
    for word in re.findall(r"`([a-z_]+(?:\.[a-z_]+)*)`", docstring(folder)):
        assert f"{module_name(folder)}.{word}" in MODULES or word in MODULES, (
            f"there is no `{word}` in {module_name(folder)}"
        )


def test_every_folder_is_a_room_in_the_order_of_its_package() -> None:
    folders = {module_name(path) for path in MODULES.values() if path.name == "__init__.py"} - {"whyhot"}
    assert folders == {module_name(folder) for folder in FOLDERS}


def test_keys_see_every_import() -> None:
    for module, others in graph().items():
        computing = {other for other in others if not other.startswith("whyhot")}  # version and installation
        assert imported(module) - {module} == computing, module


# Not imported by any verb, and why it is there. What a replay or a diagnosis depends on must not grow by these.
FOR_OTHERS = {
    "ingest.formats": "found by a log's name",
    "twin.paper": "the reference that our filter is measured against: docs/filters.md",
    "twin.filters.ukf": "for Python: docs/filters.md",
    "analytics.insulation.life.destructive": "for Python: docs/life.md",
    "analytics.reference": "writes docs/sql.md",
    "replay.show.notebooks.cells": "what the notebooks show",
}


def test_each_module_is_reached_by_a_verb_or_says_whom_it_is_for() -> None:
    reached, left = set[str](), [name for name in MODULES if name.startswith(("replay.cli", "whyhot"))]
    while left:
        module = left.pop()
        if module not in reached:
            reached.add(module)
            left += graph()[module]
    modules = {name for name, path in MODULES.items() if path.name != "__init__.py"}
    assert modules - reached == {
        name for name in modules if f"{name}.".startswith(tuple(f"{own}." for own in FOR_OTHERS))
    }


# Asked for by their names in the list of formats, or of verbs.
BY_NAME = {
    "ingest.formats": {"reader", "claims", "no_table", "no_log", "locked", "by_name"},
    "replay.cli": {"arguments", "run", "main"},
}


def test_what_a_module_defines_is_used_by_more_than_tests() -> None:
    others = {str(path): path for folder in ("benchmarks", "notebooks") for path in (ROOT / folder).rglob("*.py")}
    used = {pair for name, path in (MODULES | others).items() for pair in _read(path).used(name)}
    for name, path in MODULES.items():
        asked = next((names for folder, names in BY_NAME.items() if name.startswith(folder)), set[str]())
        left = [one for one in _read(path).defines - asked if not one.startswith("__") and (name, one) not in used]
        assert not left, f"{name}: nothing uses {left}"


def test_tests_follow_the_rooms() -> None:
    for path in (ROOT / "tests").rglob("test_*.py"):
        place = path.parent.relative_to(ROOT / "tests")
        assert not place.parts or (ROOT / place).is_dir(), f"{path.relative_to(ROOT)}: there is no {place}"


def test_the_twin_touches_no_file_clock_or_screen() -> None:
    shell = {"pathlib", "os", "io", "time", "datetime", "logging", "tomllib", "json", "pyarrow", "duckdb"}
    for path in _modules("twin"):
        assert not _read(path).packages() & shell, path.relative_to(ROOT)
        assert not _read(path).loads & {"print", "open"}, path.relative_to(ROOT)


def test_help_imports_nothing_heavy() -> None:
    code = (
        "import sys; from replay.cli import main\n"
        "try: main(['--help'])\n"
        "except SystemExit: pass\n"
        "heavy = {'numpy', 'pyarrow', 'duckdb', 'numba', 'matplotlib', 'rerun', 'pint', 'cantools'}\n"
        "heavy &= set(sys.modules)\n"
        "assert not heavy, heavy"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_changelog_begins_with_the_version() -> None:
    from whyhot import __version__

    changelog = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert next(line for line in changelog.splitlines() if line.startswith("## ")).startswith(f"## {__version__}")
    assert f'version = "{__version__}"' in (ROOT / "pyproject.toml").read_text(encoding="utf-8")


def test_locks_name_versions_and_hashes_and_no_index() -> None:
    for lock in ("requirements.lock", "requirements-bench.lock"):
        text = (ROOT / lock).read_text(encoding="utf-8")
        packages = text.replace("\\\n", "").splitlines()
        assert len(packages) > 50
        assert [line for line in packages if "==" not in line or "--hash=sha256:" not in line] == []
        assert "://" not in text
        assert "index" not in text
