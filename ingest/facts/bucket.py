"""Sealed bytes and decoded samples in a bucket of an object store: S3, or a server that speaks as it does.

`store.json` names the URL. Whose rights are used is found as by every client of S3 (AWS_ACCESS_KEY_ID, AWS_PROFILE,
~/.aws, the role of the machine); no key stands there or in any message. The client is Arrow's. It puts an object whole
or not at all and tries again what failed, and it has no put on condition (`If-None-Match`): two that put the same
sealed file put the same bytes under the same name, and each reads back and hashes what is there then.
"""

from __future__ import annotations

import hashlib
import io
import re
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, Literal
from urllib.parse import parse_qsl, urlsplit

from ingest.errors import BucketError

if TYPE_CHECKING:
    from pyarrow.fs import S3FileSystem

SCHEME = "s3://"
EXAMPLE = "s3://BUCKET/PREFIX, or s3://BUCKET/PREFIX?endpoint_override=http://HOST:PORT for a server of your own"
SETTINGS = ("endpoint_override", "region")  # in Arrow's words
ATTEMPTS = 5  # of a request, with growing pauses between them: some 10 s
READ = 8 << 20  # bytes asked for at once where all are read
SMALL = 4 << 20  # bytes that are put in one request
PUT = 64 << 20  # bytes on their way at once
SAID = re.compile(r"AWS Error (\w+)(?: \((.*?)\))? during (\w+) operation: (.*)", re.DOTALL)
DENIED = {"ACCESS_DENIED", "INVALID_ACCESS_KEY_ID", "SIGNATURE_DOES_NOT_MATCH", "INVALID_CLIENT_TOKEN_ID"}
DENIED |= {"EXPIRED_TOKEN", "MISSING_AUTHENTICATION_TOKEN", "UNRECOGNIZED_CLIENT"}


def is_bucket(text: str) -> bool:
    """Whether `text` names a bucket."""
    return text.lower().startswith(SCHEME)


@dataclass(frozen=True)
class Bucket:
    """What a URL of store.json names. Raises BucketError for what is no such URL, or holds a key."""

    url: str

    def __post_init__(self) -> None:
        parts = urlsplit(self.url)
        settings = parse_qsl(parts.query, keep_blank_values=True)
        shown = f"s3://{parts.netloc.rpartition('@')[2]}{parts.path}"
        if "@" in self.url or any("key" in name or "token" in name for name, _ in settings):
            raise BucketError(
                f"{shown}: the URL holds a key, which would be kept in store.json: take it out and put it into "
                "~/.aws/credentials (AWS_PROFILE) or into AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY"
            )
        if strange := [name for name, _ in settings if name not in SETTINGS]:
            raise BucketError(f"{shown}: {strange[0]!r} is no setting of it, only {' and '.join(SETTINGS)}: {EXAMPLE}")
        if not (
            re.fullmatch(r"[a-z0-9][a-z0-9.-]{1,61}[a-z0-9]", parts.netloc)
            and re.fullmatch(r"(/[A-Za-z0-9_][A-Za-z0-9._-]*)+/?", parts.path)
            and not parts.fragment
        ):
            raise BucketError(f"{shown}: is not the URL of a place in a bucket: give one like {EXAMPLE}")

    def __str__(self) -> str:
        return f"s3://{self.name}/{self.prefix}"

    @property
    def name(self) -> str:
        return urlsplit(self.url).netloc

    @property
    def prefix(self) -> str:
        """What the name of each object of the store begins with; Arrow and DuckDB call it by bucket and prefix."""
        return urlsplit(self.url).path.strip("/")

    @property
    def root(self) -> ObjectPath:
        return ObjectPath(self, f"{self.name}/{self.prefix}")

    def client(self, in_parts: bool = False) -> S3FileSystem:
        """The connection, one a process; `in_parts`: that for what is put in several requests. Raises BucketError where
        the bucket is not there or not to be reached."""
        settings = dict(parse_qsl(urlsplit(self.url).query))
        return _client(self.name, settings.get("endpoint_override"), settings.get("region"), in_parts)


@cache
def _client(bucket: str, endpoint: str | None, region: str | None, in_parts: bool) -> S3FileSystem:
    from pyarrow import fs  # what a store in a folder does not need

    client = fs.S3FileSystem(
        endpoint_override=endpoint,
        region=region,
        retry_strategy=fs.AwsStandardS3RetryStrategy(max_attempts=ATTEMPTS),
        # One request for a small object; a large one whose first request failed would end as an empty one.
        allow_delayed_open=not in_parts,
    )
    with plain_words(f"{SCHEME}{bucket}"):
        if client.get_file_info(bucket).type == fs.FileType.NotFound:
            raise BucketError(f"{SCHEME}{bucket}: there is no such bucket: make it, or correct the URL")
    return client


@contextmanager
def plain_words(where: object) -> Iterator[None]:
    """What the client complains of, raised as a BucketError; that an object is not there stays a FileNotFoundError."""
    try:
        yield
    except FileNotFoundError:
        raise
    except OSError as error:
        found = SAID.search(str(error))
        code, status, call, text = found.groups() if found else ("", "", "", str(error))
        says = " ".join(f"{call}: {code} {status or ''} {text}".split())[:200].strip(" :.")
        if code in DENIED or "403" in (status or ""):
            raise BucketError(
                f"{where}: is refused ({says}): the key that AWS_PROFILE or AWS_ACCESS_KEY_ID names needs the right to "
                "list, read, put and remove objects there"
            ) from None
        raise BucketError(
            f"{where}: the server does not answer as it should ({says}): what was recorded before is kept; run the "
            "same command again when it does"
        ) from None


@dataclass(frozen=True)
class ObjectPath:
    """An object, or all whose names begin so, in those words of `pathlib` that a store asks of its files. `key`: bucket
    and name. Each call raises BucketError where the server refuses or does not answer."""

    bucket: Bucket
    key: str

    def __truediv__(self, name: str) -> ObjectPath:
        return ObjectPath(self.bucket, f"{self.key}/{name}")

    def __str__(self) -> str:
        return f"{SCHEME}{self.key}"

    @property
    def name(self) -> str:
        return self.key.rpartition("/")[2]

    @property
    def parent(self) -> ObjectPath:
        return ObjectPath(self.bucket, self.key.rpartition("/")[0])

    def absolute(self) -> ObjectPath:
        return self

    def is_file(self) -> bool:
        return self._info() == "File"

    def exists(self) -> bool:
        return self._info() != "NotFound"

    def glob(self, pattern: str) -> Iterator[ObjectPath]:
        """What lies as deep as `pattern` (`*`, `*/*` ...) has stars, objects and folders."""
        depth = self.key.count("/") + pattern.count("*")
        found = self._listed(deep="/" in pattern)
        yield from (ObjectPath(self.bucket, key) for key, _ in found if key.count("/") == depth)

    def sizes(self) -> list[int]:
        """The bytes of the object, or of all objects under it."""
        if self.is_file():
            with self.open() as file:
                return [file.seek(0, io.SEEK_END)]
        return [size for _, size in self._listed(deep=True) if size is not None]

    def open(self, mode: Literal["rb"] = "rb") -> io.BufferedReader:
        """The bytes, read many at once. Raises FileNotFoundError."""
        return io.BufferedReader(_Bytes(self), READ)

    def parts(self) -> BinaryIO:
        """The bytes for a reader that asks for the parts it wants. Raises FileNotFoundError."""
        return _Bytes(self)  # type: ignore[return-value]

    def read_bytes(self) -> bytes:
        with self.open() as file:
            return file.read()

    def put(self, made: Path) -> None:
        """Make all bytes of the file `made` this object, whole or not at all, and read them back."""
        with ThreadPoolExecutor(1) as beside:  # Ctrl-C reaches the main thread alone: an object is not ended early
            beside.submit(self._put, made).result()
        with self.open() as back, made.open("rb") as true:
            if hashlib.file_digest(back, "sha256").digest() != hashlib.file_digest(true, "sha256").digest():
                raise BucketError(f"{self}: does not give back what was put there: run the same command again")

    def remove(self) -> None:
        """Remove the object, or all under it; nothing where there is none."""
        kind = self._info()
        with plain_words(self), suppress(FileNotFoundError):
            if kind == "File":
                self.bucket.client().delete_file(self.key)
            elif kind == "Directory":
                self.bucket.client().delete_dir(self.key)

    def _info(self) -> str:
        with plain_words(self):
            return str(self.bucket.client().get_file_info(self.key).type.name)

    def _listed(self, deep: bool) -> list[tuple[str, int | None]]:
        from pyarrow.fs import FileSelector

        with plain_words(self):
            asked = FileSelector(self.key, allow_not_found=True, recursive=deep)
            return sorted((one.path, one.size) for one in self.bucket.client().get_file_info(asked))

    def _put(self, made: Path) -> None:
        import pyarrow as pa

        size = made.stat().st_size
        with plain_words(self):
            out = self.bucket.client(in_parts=size > SMALL).open_output_stream(self.key)
            if size <= SMALL:
                out.write(made.read_bytes())
                out.close()
                return
            try:
                with pa.memory_map(str(made)) as source:
                    while len(some := source.read_buffer(PUT)):
                        out.write(some)
                        out.flush()
                out.close()
            except OSError:  # once a part has failed, the end is refused too: no object comes of it
                with suppress(OSError):
                    out.close()
                raise


Place = Path | ObjectPath  # of a file or folder of a store


def listed(folder: Place, pattern: str) -> list[Place]:
    """What `folder.glob(pattern)` finds, in order."""
    found: list[Place] = [*folder.glob(pattern)]
    return sorted(found, key=str)


class _Bytes(io.RawIOBase):
    """An object that is read by range, in our words where that fails."""

    def __init__(self, path: ObjectPath) -> None:
        self._path = path
        with plain_words(path):
            self._file = path.bucket.client().open_input_file(path.key)

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        return int(self._file.seek(offset, whence))

    def tell(self) -> int:
        return int(self._file.tell())

    def readinto(self, into: Any) -> int:
        with plain_words(self._path):
            return int(self._file.readinto(into))

    def close(self) -> None:
        self._file.close()
        super().close()
