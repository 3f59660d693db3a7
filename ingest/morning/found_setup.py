"""What explains logs where nobody said it: the bench file and databases that lie with them, else those of the store."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from ingest.bench.bench_file import SCHEMA, read_bench
from ingest.errors import IngestError
from ingest.facts.facts import Facts
from ingest.intake.setup import MotorFile, Setup, prepare, sealed_setup
from ingest.texts.toml_file import LARGEST

if TYPE_CHECKING:
    from ingest.facts.store import Store

DATABASES = (".dbc", ".kcd", ".sym", ".arxml")


@dataclass(frozen=True)
class FoundSetup:
    """A setup, and in a few words where it is from."""

    setup: Setup
    source: str

    def explains(self, skipped: str) -> bool:
        """Whether a file that is no log, named at the beginning of a line, is one of the setup."""
        bench = self.setup.bench
        names = [one.name for one in self.setup.databases] + ([bench.name, bench.motor or ""] if bench else [])
        return skipped.partition(":")[0] in names


def found_setup(
    arguments: Sequence[Path],
    logs: Sequence[Path],
    bench: Path | None,
    databases: Sequence[Path],
    motor_file: Callable[[Path], MotorFile],
    past: tuple[Store, Facts] | None,
) -> FoundSetup:
    """The bench file and databases that are named; else those in the folders given, where there is one bench file;
    else those of the last session of the store. Raises as `prepare` for what is named."""
    if bench or databases:
        return FoundSetup(prepare(logs, bench, databases, motor_file), "as named")
    benches, there = _lying(arguments)
    if len(benches) == 1:
        files = [benches[0], *there]
        return FoundSetup(prepare(logs, benches[0], there, motor_file), ", ".join(path.name for path in files))
    if past and not benches and (last := _last_setup(*past, motor_file)):
        return last
    beside = prepare(logs, None, there, motor_file)
    says = "no bench file" if not benches else f"no bench file: {len(benches)} lie there, name one with --bench"
    return FoundSetup(beside, says)


def _lying(arguments: Sequence[Path]) -> tuple[list[Path], list[Path]]:
    """Bench files and signal databases in the folders among the arguments, in all that lies in these."""
    folders = [argument for argument in arguments if argument.is_dir()]
    files = sorted(path for folder in folders for path in folder.rglob("*") if path.is_file())
    benches = [path for path in files if path.suffix.lower() == ".toml" and _is_bench(path)]
    return benches, [path for path in files if path.suffix.lower() in DATABASES]


def _is_bench(path: Path) -> bool:
    """Whether a file says that it is a bench file; one that says nothing is one if it reads as one."""
    try:
        data = path.read_bytes()[:LARGEST]
        return SCHEMA.encode() in data or bool(read_bench(data, path.name).channels)
    except (OSError, IngestError):
        return False


def _last_setup(store: Store, facts: Facts, motor_file: Callable[[Path], MotorFile]) -> FoundSetup | None:
    """What the last log with a bench file was decoded with; of its motor file what lies in the archive."""
    decodes = [one for one in facts.decodes.values() if one.bench and one.outcome != "quarantined"]
    if not decodes:
        return None
    last = decodes[-1]
    setup = sealed_setup(store, facts, last)
    if last.model:
        motor = motor_file(store.archive.path(last.model))
        setup = replace(setup, motor=replace(motor, file=facts.models[last.model].file))
    name = facts.benches[str(last.bench)].name
    return FoundSetup(setup, f"{name} of the store, as {facts.files[last.raw].name} came with")
