"""One log read by a child process of its own."""

from contextlib import closing
from pathlib import Path
from typing import Any

from ingest.log.reading import LogReading, Reader


def record(path: Path, target: Path, *more: Any, **named: Any) -> LogReading:
    """`Reader.record` of a new reader."""
    with closing(Reader()) as reader:
        return reader.record(path, target, *more, **named)
