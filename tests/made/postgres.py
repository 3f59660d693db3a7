"""A PostgreSQL server of a test's own: in a new folder, on a socket there, under a user of its own where needed."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

NOBODY = "nobody"  # PostgreSQL refuses to run as root


class PostgresServer:
    """A running server of one database; without a password for all but the user `locked`."""

    def __init__(self, folder: Path, programs: Path) -> None:
        self._folder = folder
        self._programs = programs
        if root := os.geteuid() == 0:
            shutil.chown(folder, NOBODY)
        self._as: dict[str, Any] = {"user": NOBODY, "group": _group(), "extra_groups": []} if root else {}
        self._run("initdb", "-D", "data", "-U", "lab", "-A", "trust", "--no-sync", "-E", "UTF8", "--locale=C")
        access = folder / "data" / "pg_hba.conf"
        access.write_text("local all locked scram-sha-256\n" + access.read_text())
        self.start()

    @property
    def url(self) -> str:
        return self.url_of("lab")

    def url_of(self, user: str) -> str:
        return f"postgresql://{user}@/postgres?host={self._folder}"

    def start(self) -> None:
        # Without fsync: what a killed server wrote is with the system.
        settings = f"-k {self._folder} -c listen_addresses='' -c fsync=off -c max_connections=60"
        self._run("pg_ctl", "start", "-w", "-D", "data", "-l", "log", "-o", settings)

    def stop(self, mode: str = "immediate") -> None:
        self._run("pg_ctl", "stop", "-w", "-D", "data", "-m", mode)

    def sql(self, statement: str, *values: object) -> list[tuple[Any, ...]]:
        """Run statements as someone would who writes to the database."""
        import psycopg

        with psycopg.connect(self.url) as connection:
            done = connection.execute(statement, values or None)
            return done.fetchall() if done.description else []

    def _run(self, program: str, *words: str) -> None:
        command = [str(self._programs / program), *words]
        with (self._folder / "said").open("ab") as said:
            subprocess.run(command, cwd=self._folder, check=True, stdout=said, stderr=said, **self._as)


def why_none() -> str | None:
    """Why no server can be started here, in one line; None where one can."""
    if sys.platform == "win32":
        return "PostgreSQL is started on a socket in a folder, which Windows lacks"
    if _programs() is None:
        return "PostgreSQL is not installed (Debian: apt-get install postgresql)"
    return None if find_spec("psycopg") else "psycopg is not installed (the extra `postgres`)"


@contextmanager
def postgres() -> Iterator[PostgresServer]:
    """A server that is gone at the end, with its folder."""
    programs = _programs()
    assert programs is not None
    folder = Path(mkdtemp(prefix="whyhot-pg-", dir="/tmp"))  # the name of a socket is short
    try:
        server = PostgresServer(folder, programs)
        try:
            yield server
        finally:
            server.stop()
    finally:
        shutil.rmtree(folder)


def _programs() -> Path | None:
    there = shutil.which("initdb")
    debian = sorted(Path("/usr/lib/postgresql").glob("*/bin/initdb"))
    return Path(there).parent if there else debian[-1].parent if debian else None


def _group() -> int:
    import pwd  # not on Windows

    return pwd.getpwnam(NOBODY).pw_gid
