"""What explains logs where nobody said it: the bench file and databases that lie with them, else those of the store."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from ingest.bench.bench_file import SCHEMA, read_bench
from ingest.errors import DatabaseError, IngestError
from ingest.facts.durable import scratch
from ingest.facts.facts import Facts
from ingest.intake.given import databases_in, files_in
from ingest.intake.intake import Intake
from ingest.intake.setup import MotorFile, Setup, prepare, sealed_setup
from ingest.log.databases import Database, load
from ingest.texts.toml_file import LARGEST

if TYPE_CHECKING:
    from ingest.facts.store import Store

NO_BENCH = "no bench file"


@dataclass(frozen=True)
class FoundSetup:
    """A setup, and in a few words where it is from. `unread`: why databases that lie with the logs are left out."""

    setup: Setup
    source: str
    named: bool = False  # by the one who asks: where it does not fit, that is refused
    unread: tuple[str, ...] = ()

    def explains(self, skipped: str) -> bool:
        """Whether a file that is no log, named at the beginning of a line, is one of the setup, or would be if it could
        be read."""
        bench = self.setup.bench
        names = [one.name for one in self.setup.databases] + ([bench.name, bench.motor or ""] if bench else [])
        return skipped.partition(":")[0] in [*names, *(line.partition(":")[0] for line in self.unread)]


def found_setup(
    arguments: Sequence[Path],
    logs: Sequence[Path],
    bench: Path | None,
    databases: Sequence[Path],
    motor_file: Callable[[Path], MotorFile],
    past: tuple[Store, Facts] | None,
) -> FoundSetup:
    """The bench file and databases that are named; else those in the folders given, where there is one bench file, and
    without databases that cannot be read; else those of the last session of the store. Raises as `prepare` for what is
    named."""
    if bench or databases:
        given = ", ".join(path.name for path in (bench, *databases) if path)
        return FoundSetup(prepare(logs, bench, databases, motor_file), f"{given}, as given", named=True)
    benches, there, unread = _lying(arguments)
    if len(benches) > 1:
        return _without(there, f"no bench file: the folder holds {len(benches)}, name one with --bench", unread)
    if benches:
        try:
            setup = replace(prepare(logs, benches[0], (), motor_file), databases=there)
        except IngestError as error:
            return _without(there, f"no bench file: {error}", unread)
        source = ", ".join([benches[0].name, *(one.name for one in there)])
        return FoundSetup(setup, source, unread=unread)
    return (_last_setup(*past, motor_file) if past else None) or _without(there, NO_BENCH, unread)


def taken_as_found(found: FoundSetup, take: Callable[[Setup], Intake]) -> tuple[FoundSetup, Intake]:
    """The logs taken in with what was found, or, where nobody named it and it does not fit them, without its bench
    file. Raises as `take`."""
    try:
        return found, take(found.setup)
    except IngestError as error:
        if found.named or found.setup.bench is None:
            raise
        setup = replace(found.setup, bench=None, bench_data=b"", motor=None, model=None)
        source = f"no bench file, as {found.setup.bench.name} does not fit: {error}"
        return FoundSetup(setup, source, unread=found.unread), take(setup)


def _without(databases: tuple[Database, ...], source: str, unread: tuple[str, ...]) -> FoundSetup:
    return FoundSetup(Setup(None, b"", databases, None), source, unread=unread)


def _lying(arguments: Sequence[Path]) -> tuple[list[Path], tuple[Database, ...], tuple[str, ...]]:
    """Bench files and signal databases in the folders among the arguments, in all that lies in these; and a line for
    each database that cannot be read."""
    folders = [argument for argument in arguments if argument.is_dir()]
    files = [path for folder in folders for path in files_in(folder)]
    benches = [path for path in files if path.suffix.lower() == ".toml" and _is_bench(path)]
    databases, unread = [], []
    for path in (path for folder in folders for path in databases_in(folder)):
        try:
            databases.append(load(path.read_bytes(), path.name))
        except DatabaseError as error:
            unread.append(f"{error} Left out.")
    return benches, tuple(databases), tuple(unread)


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
        with scratch() as folder:
            named = folder / last.model
            store.archive.lend(last.model, named)
            motor = motor_file(named)
        setup = replace(setup, motor=replace(motor, file=facts.models[last.model].file))
    name = facts.benches[str(last.bench)].name
    return FoundSetup(setup, f"{name} of the store, which {facts.files[last.raw].name} was read with")
