"""A PostgreSQL server for the tests of ledgers there."""

from collections.abc import Iterator

import pytest

from made.postgres import PostgresServer, postgres


@pytest.fixture(scope="session")
def server() -> Iterator[PostgresServer]:
    with postgres() as started:
        yield started
