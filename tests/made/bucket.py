"""An S3 server of a test's own on loopback: buckets in memory, faults on demand, and no conditional put honoured.

What it knows of the protocol is what a store asks for: objects put whole or in parts, read whole or by range, listed,
removed. An object is there only when all its bytes came.
"""

from __future__ import annotations

import hashlib
import re
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from urllib.parse import parse_qs, unquote, urlsplit
from uuid import uuid4
from xml.sax.saxutils import escape

import pytest

from ingest.facts import bucket as door

KEYS = {"AWS_ACCESS_KEY_ID": "lab", "AWS_SECRET_ACCESS_KEY": "words", "AWS_EC2_METADATA_DISABLED": "true"}
Fault = Callable[[str, str], str | None]  # method, key -> "503", "cut", "slow", "denied" or None


@dataclass
class BucketServer:
    """A running server with one bucket "lab". `fault` is asked at each request; `asked`: (method, key) of all."""

    port: int = 0
    objects: dict[str, bytes] = field(default_factory=dict)
    parts: dict[str, dict[int, bytes]] = field(default_factory=dict)
    asked: list[tuple[str, str]] = field(default_factory=list)
    fault: Fault = lambda method, key: None
    gone: bool = False
    slow_s: float = 4.0  # longer than a client waits for a first byte

    def url(self, prefix: str = "store", bucket: str = "lab") -> str:
        return f"s3://{bucket}/{prefix}?endpoint_override=http://127.0.0.1:{self.port}&region=us-east-1"

    def names(self, prefix: str = "store/") -> list[str]:
        """The objects under `prefix`, without the empty ones that Arrow keeps for folders."""
        return sorted(key for key in self.objects if key.startswith(prefix) and not key.endswith("/"))


@contextmanager
def bucket_server() -> Iterator[BucketServer]:
    """A server that is gone at the end."""
    state = BucketServer()
    server = ThreadingHTTPServer(("127.0.0.1", 0), type("Handler", (_Handler,), {"state": state}))
    server.daemon_threads = True
    state.port = server.server_port
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02})
    thread.start()
    try:
        yield state
    finally:
        state.gone = True  # for connections that stay open
        server.shutdown()
        thread.join()
        server.server_close()


def with_keys(monkeypatch: pytest.MonkeyPatch) -> None:
    """A key that this server does not look at, found where every client of S3 looks; little patience with a server."""
    for name, value in KEYS.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr(door, "ATTEMPTS", 3)
    door._client.cache_clear()


class _Handler(BaseHTTPRequestHandler):
    state: BucketServer
    protocol_version = "HTTP/1.1"
    wbufsize = -1  # head and body of an answer leave together

    def handle_expect_100(self) -> bool:
        done = super().handle_expect_100()
        self.wfile.flush()  # the client waits a second for it
        return done

    def log_message(self, format: str, *args: object) -> None:
        """Nothing of it on the terminal."""

    def _handle(self) -> None:
        if self.state.gone:
            self.close_connection = True
            return
        url = urlsplit(self.path)
        bucket, _, key = unquote(url.path).lstrip("/").partition("/")
        asked = {name: values[0] for name, values in parse_qs(url.query, keep_blank_values=True).items()}
        self.state.asked.append((self.command, key))
        fault = self.state.fault(self.command, key)
        if fault == "slow":
            time.sleep(self.state.slow_s)
        body = self._body(cut=fault == "cut")
        if fault == "503":
            self._refuse(503, "SlowDown")
        elif fault == "denied":
            self._refuse(403, "AccessDenied")
        elif bucket != "lab":
            self._refuse(404, "NoSuchBucket")
        elif body is None:  # the client's bytes did not all come: nothing is kept
            self.close_connection = True
        else:
            getattr(self, f"_{self.command.lower()}")(key, asked, body, fault == "cut")

    def handle(self) -> None:
        with suppress(ConnectionError):  # a client may be killed
            super().handle()

    do_GET = do_HEAD = do_PUT = do_POST = do_DELETE = _handle

    def _body(self, cut: bool) -> bytes | None:
        """What the client sends; with `cut` the server hangs up in the middle of it."""
        length = int(self.headers.get("Content-Length") or 0)
        if "chunked" in self.headers.get("Transfer-Encoding", ""):
            data = self._chunked()
            return None if cut else data
        if cut and length:
            self.rfile.read(length // 2)
            return None
        data = self.rfile.read(length)
        if len(data) < length:
            return None
        return _unsigned(data) if "aws-chunked" in self.headers.get("Content-Encoding", "") else data

    def _chunked(self) -> bytes:
        data = bytearray()
        while size := int(self.rfile.readline().split(b";")[0], 16):
            data += self.rfile.read(size)
            self.rfile.readline()
        self.rfile.readline()
        return _unsigned(bytes(data)) if "aws-chunked" in self.headers.get("Content-Encoding", "") else bytes(data)

    def _answer(self, status: int, data: bytes = b"", cut: bool = False, **headers: str) -> None:
        self.send_response(status)
        for name, value in {"Content-Length": str(len(data)), **headers}.items():
            self.send_header(name.replace("_", "-"), value)
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(data[: len(data) // 2] if cut else data)
        if cut:
            self.close_connection = True

    def _refuse(self, status: int, code: str) -> None:
        said = f"<Error><Code>{code}</Code><Message>{code}</Message></Error>"
        self._answer(status, said.encode(), Content_Type="application/xml")

    def _xml(self, said: str, cut: bool = False) -> None:
        self._answer(200, f'<?xml version="1.0"?>{said}'.encode(), cut, Content_Type="application/xml")

    def _get(self, key: str, asked: dict[str, str], body: bytes, cut: bool) -> None:
        if not key:
            self._list(asked)
            return
        data = self.state.objects.get(key)
        if data is None:
            self._refuse(404, "NoSuchKey")
            return
        part = re.fullmatch(r"bytes=(\d+)-(\d*)", self.headers.get("Range", ""))
        first = int(part[1]) if part else 0
        last = min(int(part[2]), len(data) - 1) if part and part[2] else len(data) - 1
        named = {"ETag": f'"{hashlib.md5(data).hexdigest()}"', "Last_Modified": "Mon, 03 Mar 2025 08:00:00 GMT"}
        if part:
            named["Content_Range"] = f"bytes {first}-{last}/{len(data)}"
        self._answer(206 if part else 200, data[first : last + 1], cut, **named)

    def _head(self, key: str, asked: dict[str, str], body: bytes, cut: bool) -> None:
        if key:
            self._get(key, asked, body, cut)
        else:
            self._answer(200)

    def _put(self, key: str, asked: dict[str, str], body: bytes, cut: bool) -> None:
        if "uploadId" in asked:
            self.state.parts[asked["uploadId"]][int(asked["partNumber"])] = body
        else:
            self.state.objects[key] = body
        self._answer(200, ETag=f'"{hashlib.md5(body).hexdigest()}"')

    def _post(self, key: str, asked: dict[str, str], body: bytes, cut: bool) -> None:
        if "delete" in asked:
            for gone in re.findall(rb"<Key>(.*?)</Key>", body):
                self.state.objects.pop(gone.decode(), None)
            self._xml("<DeleteResult></DeleteResult>")
        elif "uploads" in asked:
            upload = uuid4().hex
            self.state.parts[upload] = {}
            named = f"<Bucket>lab</Bucket><Key>{escape(key)}</Key><UploadId>{upload}</UploadId>"
            self._xml(f"<InitiateMultipartUploadResult>{named}</InitiateMultipartUploadResult>")
        else:
            parts = self.state.parts.pop(asked["uploadId"])
            self.state.objects[key] = b"".join(parts[number] for number in sorted(parts))
            self._xml(
                f'<CompleteMultipartUploadResult><ETag>"{asked["uploadId"]}"</ETag></CompleteMultipartUploadResult>'
            )

    def _delete(self, key: str, asked: dict[str, str], body: bytes, cut: bool) -> None:
        if "uploadId" in asked:
            self.state.parts.pop(asked["uploadId"], None)
        else:
            self.state.objects.pop(key, None)
        self._answer(204)

    def _list(self, asked: dict[str, str]) -> None:
        prefix, delimiter = asked.get("prefix", ""), asked.get("delimiter", "")
        keys, folders = list[str](), dict[str, None]()
        for key in sorted(self.state.objects):
            if not key.startswith(prefix):
                continue
            head, found, _ = key[len(prefix) :].partition(delimiter) if delimiter else ("", "", "")
            if found:
                folders[prefix + head + delimiter] = None
            else:
                keys.append(key)
        keys = keys[: int(asked.get("max-keys", 1000))]
        listed = "".join(
            f"<Contents><Key>{escape(key)}</Key><Size>{len(self.state.objects[key])}</Size>"
            "<LastModified>2025-03-03T08:00:00.000Z</LastModified></Contents>"
            for key in keys
        )
        common = "".join(f"<CommonPrefixes><Prefix>{escape(one)}</Prefix></CommonPrefixes>" for one in folders)
        said = f"<KeyCount>{len(keys) + len(folders)}</KeyCount><IsTruncated>false</IsTruncated>{listed}{common}"
        self._xml(f"<ListBucketResult>{said}</ListBucketResult>")


def _unsigned(data: bytes) -> bytes:
    """A body in chunks with a checksum behind them (aws-chunked), as plain bytes."""
    plain, at = bytearray(), 0
    while True:
        end = data.index(b"\r\n", at)
        size = int(data[at:end].split(b";")[0], 16)
        if not size:
            return bytes(plain)
        plain += data[end + 2 : end + 2 + size]
        at = end + 2 + size + 2
