"""Frames of logs as tests compare them, and messages of every kind for python-can's own writers."""

import random
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import can

from ingest.formats import EXTENDED, FD, REMOTE, TRANSMIT, Frames, Log, TimeSpec, open_log

START_S = 1_700_000_000
Frame = tuple[int, Any, int, int, str]  # t_ns, bus, can_id, flags, payload in hexadecimal


def read(path: Path, spec: TimeSpec | None = None) -> tuple[Log, list[Frame]]:
    """The log at `path` and its frames in order."""
    log = open_log(path, spec)
    frames: list[Frame] = []
    for batch in log.batches():
        assert isinstance(batch, Frames)
        payloads = [batch.data[a:b].tobytes().hex() for a, b in zip(batch.offsets[:-1], batch.offsets[1:], strict=True)]
        columns = (array.tolist() for array in (batch.t_ns, batch.bus, batch.can_id, batch.flags))
        frames += zip(*columns, payloads, strict=True)
    return log, frames


def messages(count: int, *, fd: bool = True) -> list[can.Message]:
    """A message a millisecond: standard and extended, received and sent, CAN FD, remote and error frames, two buses."""
    chance = random.Random(count)
    made = []
    for number in range(count):
        extended, long = number % 3 == 0, fd and number % 7 == 0
        message = can.Message(
            timestamp=START_S + number / 1000,
            arbitration_id=chance.randrange(1 << (29 if extended else 11)),
            is_extended_id=extended,
            is_fd=long,
            is_rx=number % 2 == 0,
            channel=number % 2 + 1,
            data=chance.randbytes(chance.choice((12, 64)) if long else chance.randrange(9)),
        )
        if number % 50 == 49:
            message = can.Message(timestamp=message.timestamp, is_error_frame=True, channel=1)
        elif number % 50 == 48:
            message = can.Message(timestamp=message.timestamp, is_remote_frame=True, arbitration_id=4, channel=1)
        made.append(message)
    return made


def write(writer: can.Listener, some: Iterable[can.Message]) -> None:
    """Let a writer of python-can write messages."""
    for message in some:
        writer.on_message_received(message)
    writer.stop()


def as_frames(some: Iterable[can.Message], *, without_bus: bool = False, ways: bool = True) -> list[Frame]:
    """Messages but for error frames, in our words; as a log tells them that has no bus, or no direction."""
    return [
        (
            round(message.timestamp * 1e6) * 1000,
            1 if without_bus else message.channel,
            message.arbitration_id | int(EXTENDED) * message.is_extended_id,
            FD * message.is_fd | REMOTE * message.is_remote_frame | TRANSMIT * (ways and not message.is_rx),
            "" if message.is_remote_frame else bytes(message.data).hex(),
        )
        for message in some
        if not message.is_error_frame
    ]
