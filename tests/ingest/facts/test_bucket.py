"""A bucket as a place of bytes: whole or not there, whatever the server does, and in one line what cannot be used."""

from __future__ import annotations

import hashlib
import io
import threading
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from pyarrow import fs

from ingest.errors import BucketError, DamageError
from ingest.facts import bucket as door
from ingest.facts.archive import Archive
from ingest.facts.bucket import Bucket, ObjectPath, listed
from ingest.log import samples
from made.bucket import BucketServer, bucket_server

DATA = bytes(range(256)) * 20
SHA = hashlib.sha256(DATA).hexdigest()


@pytest.fixture
def root(bucket: BucketServer) -> ObjectPath:
    return Bucket(bucket.url()).root


@pytest.fixture
def file(tmp_path: Path) -> Callable[[bytes], Path]:
    def made(data: bytes) -> Path:
        path = tmp_path / f"{len(data)}.bin"
        path.write_bytes(data)
        return path

    return made


@pytest.fixture
def archive(root: ObjectPath, tmp_path: Path) -> Archive:
    return Archive(root / "archive", tmp_path)


def first(count: int, what: str, methods: str = "GET HEAD PUT POST") -> Callable[[str, str], str | None]:
    """A server that does `what` at the first `count` requests of these methods."""
    left = [count]

    def fault(method: str, key: str) -> str | None:
        if method not in methods or not left[0]:
            return None
        left[0] -= 1
        return what

    return fault


def nth(number: int, what: str) -> Callable[[str, str], str | None]:
    seen = [0]

    def fault(method: str, key: str) -> str | None:
        seen[0] += 1
        return what if seen[0] == number else None

    return fault


def test_it_has_the_words_of_a_folder(root: ObjectPath, file: Callable[[bytes], Path], bucket: BucketServer) -> None:
    path = root / "archive" / "ab" / "x"
    assert not path.exists()
    path.put(file(DATA))
    (root / "empty").put(file(b""))
    assert (str(path), path.name, str(path.parent)) == (f"{root}/archive/ab/x", "x", f"{root}/archive/ab")
    assert path.is_file()
    assert path.parent.exists()
    assert not path.parent.is_file()
    assert (path.read_bytes(), (root / "empty").read_bytes()) == (DATA, b"")
    assert [str(one) for one in listed(root, "*")] == [f"{root}/archive", f"{root}/empty"]
    assert listed(root / "archive", "*/*") == [path]
    assert (path.sizes(), sorted(root.sizes())) == ([len(DATA)], [0, len(DATA)])
    with path.open() as opened:
        opened.seek(-3, io.SEEK_END)
        assert opened.read() == DATA[-3:]
    with pytest.raises(FileNotFoundError):
        (root / "none").open()
    (root / "none").remove()
    (root / "archive").remove()
    assert bucket.names() == ["store/empty"]


def test_sealed_bytes_are_put_once_read_back_and_mended(archive: Archive, bucket: BucketServer) -> None:
    key = f"store/archive/{SHA[:2]}/{SHA}"
    assert archive.seal(DATA) == archive.seal(DATA) == SHA
    assert [one for one in bucket.asked if one[0] == "PUT"] == [("PUT", key)]
    assert (archive.read(SHA), archive.size(SHA), [*archive]) == (DATA, len(DATA), [SHA])
    bucket.objects[key] = DATA[:-1]
    assert "is damaged, its 5,119 bytes are not those that were sealed" in str(archive.damage(SHA))
    assert archive.seal(DATA) == SHA
    assert bucket.objects.pop(key) == DATA
    with pytest.raises(DamageError, match=rf"^s3://lab/{key}: is missing: "):
        archive.read(SHA)


def test_what_is_lent_is_a_copy_that_was_hashed(archive: Archive, bucket: BucketServer, tmp_path: Path) -> None:
    archive.lend(archive.seal(DATA), tmp_path / "log.blf")
    assert (tmp_path / "log.blf").read_bytes() == DATA
    bucket.objects[f"store/archive/{SHA[:2]}/{SHA}"] = DATA[::-1]
    with pytest.raises(DamageError, match="is damaged"):
        archive.lend(SHA, tmp_path / "again.blf")


def test_eight_that_seal_the_same_at_once_leave_it_whole(bucket: BucketServer, archive: Archive) -> None:
    """The server honours no put on condition: the last one wins, with the same bytes."""
    begun, second = threading.Lock(), threading.Event()

    def fault(method: str, key: str) -> None:
        if method == "PUT" and not begun.acquire(blocking=False):
            second.set()
        elif method == "PUT":  # the first, after which the others would find the object
            second.wait(timeout=30)

    def seal() -> None:
        assert archive.seal(DATA) == SHA

    bucket.fault = fault
    threads = [threading.Thread(target=seal) for _ in range(8)]
    for one in threads:
        one.start()
    for one in threads:
        one.join()
    assert sum(method == "PUT" for method, _ in bucket.asked) > 1
    assert list(bucket.objects.values()) == [DATA]


@pytest.mark.parametrize(("what", "count"), [("503", 1), ("cut", 1), ("slow", 1)])
def test_a_server_that_stumbles_is_asked_again(
    what: str,
    count: int,
    root: ObjectPath,
    file: Callable[[bytes], Path],
    bucket: BucketServer,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(fs, "S3FileSystem", partial(fs.S3FileSystem, request_timeout=1.0))
    monkeypatch.setattr(door, "_client", cache(door._client.__wrapped__))
    bucket.slow_s = 1.8
    bucket.fault = first(count, what, "PUT")
    path = root / "x"
    path.put(file(DATA))
    bucket.fault = first(count, what, "GET")
    assert path.read_bytes() == DATA
    asked = [method for method, _ in bucket.asked]
    assert (asked.count("PUT"), asked.count("GET")) == (1 + count * (what != "slow"), 2 + count)


def test_whatever_request_fails_for_good_no_half_object_is_seen(
    root: ObjectPath, file: Callable[[bytes], Path], bucket: BucketServer
) -> None:
    """Of an object in one request and of one in parts, with each request refused in turn."""
    for data in (DATA, bytes(11 << 20)):
        for number in range(1, 20):
            bucket.fault = nth(number, "denied")
            bucket.asked.clear()
            try:
                (root / "x").put(file(data))
            except BucketError as error:
                assert " is refused (" in str(error)
            else:
                assert number == len(bucket.asked) + 1, "each request was refused once"
                break
            assert bucket.objects.get("store/x") in (None, data)
            bucket.objects.pop("store/x", None)
        assert bucket.objects.pop("store/x") == data


def test_a_put_that_gives_back_other_bytes_is_refused(
    root: ObjectPath, file: Callable[[bytes], Path], bucket: BucketServer
) -> None:
    def spoil(method: str, key: str) -> None:
        if method == "HEAD" and key in bucket.objects:
            bucket.objects[key] = DATA[:100]

    bucket.fault = spoil
    with pytest.raises(BucketError, match="does not give back what was put there"):
        (root / "x").put(file(DATA))


def test_parquet_is_read_in_parts_and_a_server_that_fails_is_no_damage(
    root: ObjectPath, tmp_path: Path, bucket: BucketServer
) -> None:
    pq.write_table(pa.table({"a": [1, 2], "b": [3.0, 4.0]}), tmp_path / "t.parquet")
    path = root / "t.parquet"
    path.put(tmp_path / "t.parquet")
    assert samples.read(path, ["b"]).to_pydict() == {"b": [3.0, 4.0]}
    bucket.fault = lambda method, key: "denied"
    with pytest.raises(BucketError, match="is refused"):
        samples.read(path)
    bucket.fault = first(1, "cut", "GET")
    assert samples.read(path).num_rows == 2


@pytest.mark.parametrize(
    ("url", "says"),
    [
        ("s3://me:secret@lab/store", "holds a key"),
        ("s3://lab/store?access_key=secret", "holds a key"),
        ("s3://lab/store?endpoint_override=http://me:secret@host", "holds a key"),
        ("s3://lab/store?tls=no", "'tls' is no setting of it, only endpoint_override and region"),
        ("s3://lab", "is not the URL of a place in a bucket"),
        ("s3://lab/a/../b", "is not the URL of a place in a bucket"),
        ("s3://lab/a[b]", "is not the URL of a place in a bucket"),
        ("s3://LAB/store", "is not the URL of a place in a bucket"),
    ],
)
def test_what_is_no_url_of_a_bucket_is_refused_without_its_secrets(url: str, says: str) -> None:
    with pytest.raises(BucketError, match=says) as raised:
        Bucket(url)
    assert "secret" not in str(raised.value)


def test_a_bucket_that_is_missing_closed_or_gone_is_said_in_one_line(
    bucket: BucketServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(BucketError, match=r"^s3://other: there is no such bucket: make it, or correct the URL$"):
        (Bucket(bucket.url(bucket="other")).root / "x").open()
    bucket.fault = lambda method, key: "denied"
    with pytest.raises(BucketError, match=r"^s3://lab: is refused \(HeadBucket: ACCESS_DENIED"):
        (Bucket(bucket.url()).root / "x").open()
    monkeypatch.setattr(door, "ATTEMPTS", 1)
    with bucket_server() as other:
        (path := Bucket(other.url()).root / "x").exists()
    with pytest.raises(BucketError, match=r"the server does not answer as it should \(HeadObject: NETWORK_CONNECTION"):
        path.is_file()
