"""Bit extraction against cantools, frame by frame: any width, place, byte order, sign and law."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from cantools.database.can import Message, Signal
from cantools.database.conversion import BaseConversion
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from ingest.log.bits import Layout, Payloads, extract, padded, raw

WIDTHS = (1, 2, 3, 5, 8, 12, 24, 64)  # bytes, CAN FD included
LAWS = (1, -1, 3, 1000, 0.1, 0.5, -0.0078125, 1e-9, 2.5)
OFFSETS = (0, -40, 100.25, -273.15, 1)


def payloads(data: NDArray[np.uint8]) -> Payloads:
    """Frames of equal length, one a row of `data`."""
    count, width = data.shape
    return Payloads(padded(data.ravel()), np.arange(count) * width)


def _fits(layout: Layout, width: int) -> bool:
    return layout.bytes_needed <= width


@st.composite
def cases(draw: st.DrawFn) -> tuple[Layout, NDArray[np.uint8]]:
    width = draw(st.sampled_from(WIDTHS))
    is_float = draw(st.booleans())
    length = draw(st.sampled_from([16, 32, 64]) if is_float else st.integers(1, 64))
    big_endian, signed = draw(st.booleans()), draw(st.booleans())
    starts = [start for start in range(8 * width) if _fits(Layout(start, length, big_endian), width)]
    if not starts:
        return draw(cases())
    law = {"scale": draw(st.sampled_from(LAWS)), "offset": draw(st.sampled_from(OFFSETS))}
    layout = Layout(draw(st.sampled_from(starts)), length, big_endian, signed and not is_float, is_float, **law)
    count = draw(st.integers(1, 5))
    data = draw(st.binary(min_size=count * width, max_size=count * width))
    return layout, np.frombuffer(data, np.uint8).reshape(count, width)


def reference(layout: Layout, data: NDArray[np.uint8]) -> list[float]:
    """What cantools decodes, one frame at a time."""
    conversion = BaseConversion.factory(scale=layout.scale, offset=layout.offset, is_float=layout.is_float)
    order: Any = "big_endian" if layout.big_endian else "little_endian"
    signal = Signal("s", layout.start, layout.length, order, layout.signed, conversion=conversion)
    message = Message(1, "m", data.shape[1], [signal])
    decoded: list[Any] = [message.decode(row.tobytes(), decode_choices=False) for row in data]
    return [float(values["s"]) for values in decoded]


@settings(max_examples=400, deadline=None)
@given(cases())
def test_every_signal_equals_cantools_to_the_last_bit(case: tuple[Layout, NDArray[np.uint8]]) -> None:
    layout, data = case
    np.testing.assert_array_equal(extract(payloads(data), layout), reference(layout, data))


@pytest.mark.parametrize("big_endian", [False, True])
@pytest.mark.parametrize("length", [57, 58, 61, 63, 64])
def test_signals_over_nine_bytes_are_whole(length: int, big_endian: bool) -> None:
    data = np.random.default_rng(length).integers(0, 256, (20, 16)).astype(np.uint8)
    starts = [start for start in range(80) if _fits(Layout(start, length, big_endian), 16)]
    for start in starts:
        layout = Layout(start, length, big_endian, signed=True)
        np.testing.assert_array_equal(extract(payloads(data), layout), reference(layout, data))


@pytest.mark.parametrize(("scale", "offset"), [(3, 1), (1, -40), (-1000, 0)])
def test_a_wide_integer_law_rounds_once(scale: int, offset: int) -> None:
    data = np.array([[1, 0, 1, 0, 0, 0, 0, 0x41]], np.uint8)
    layout = Layout(0, 64, scale=scale, offset=offset)
    assert extract(payloads(data), layout).tolist() == [float(0x4100000000010001 * scale + offset)]


def test_raw_bits_are_not_sign_extended() -> None:
    data = np.array([[0x00, 0xF0]], np.uint8)
    assert raw(payloads(data), Layout(12, 4, signed=True)).tolist() == [15]
    assert extract(payloads(data), Layout(12, 4, signed=True)).tolist() == [-1.0]


def test_no_frames_give_no_values() -> None:
    assert extract(payloads(np.empty((0, 8), np.uint8)), Layout(0, 16)).shape == (0,)


@pytest.mark.parametrize(
    ("layout", "needed"),
    [
        (Layout(0, 8), 1),
        (Layout(4, 8), 2),
        (Layout(7, 8, big_endian=True), 1),
        (Layout(3, 8, big_endian=True), 2),
        (Layout(56, 8), 8),
        (Layout(7, 64, big_endian=True), 8),
    ],
)
def test_a_signal_knows_the_payload_it_needs(layout: Layout, needed: int) -> None:
    assert layout.bytes_needed == needed
