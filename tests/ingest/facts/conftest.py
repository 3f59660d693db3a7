"""A PostgreSQL server for the tests of ledgers there, and one of S3 for those of files in a bucket."""

from collections.abc import Iterator

import pytest

from made.bucket import BucketServer, bucket_server, with_keys
from made.postgres import PostgresServer, postgres


@pytest.fixture(scope="session")
def server() -> Iterator[PostgresServer]:
    with postgres() as started:
        yield started


@pytest.fixture
def bucket(monkeypatch: pytest.MonkeyPatch) -> Iterator[BucketServer]:
    with_keys(monkeypatch)
    with bucket_server() as started:
        yield started
