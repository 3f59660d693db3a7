"""Colours: seven of Okabe and Ito (2008), the yellow darkened, each with a line style, and a diverging scale.

In SVG for the report each colour becomes a CSS variable, so that one drawing serves light and dark pages.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

SERIES: Mapping[str, tuple[str, str]] = {  # name -> on white, on dark
    "blue": ("#0072b2", "#4aa8e0"),
    "vermillion": ("#d55e00", "#ff8a3d"),
    "green": ("#009e73", "#2fc79a"),
    "purple": ("#b3588f", "#e39ac6"),
    "orange": ("#c98500", "#f0b429"),
    "sky": ("#3c9fd6", "#8fd0f5"),
    "yellow": ("#8f8400", "#d8cc3c"),
}
INK = ("#1b1f24", "#e6e8eb")  # text and axes
SOFT = ("#6b7280", "#9aa3af")  # grid, band, secondary text
PAPER = ("#ffffff", "#14171b")

LEARNT, KEPT = SOFT[0], INK[0]  # sessions: colours are for models

COLOURS = tuple(light for light, _ in SERIES.values())
DASHES: tuple[Any, ...] = (  # line styles in the same order: matplotlib's (offset, on-off lengths in line widths)
    (0, (5, 1.6)),
    (0, (1.4, 1.2)),
    (0, (6, 1.6, 1.4, 1.6)),
    (0, (9, 2)),
    (0, (3, 1.4)),
    (0, (6, 1.6, 1.4, 1.6, 1.4, 1.6)),
    (0, (1.2, 2.4)),
)
DIVERGING = ("#2a86c0", "#ffffff", "#e07020")  # model too hot, right, too cold, on both pages: black is readable on all


def variables(dark: bool) -> dict[str, str]:
    """CSS variable -> value, of the light or the dark page."""
    named = {"ink": INK, "soft": SOFT, "paper": PAPER, **SERIES}
    return {f"--{name}": pair[dark] for name, pair in named.items()}


def with_variables(svg: str) -> str:
    """The light colours of an SVG text replaced by their CSS variables."""
    for name, (light, _) in {"ink": INK, "soft": SOFT, **SERIES}.items():
        svg = svg.replace(light, f"var(--{name})")
    return svg


def rival_lines() -> list[dict[str, Any]]:
    """How the rivals of a cause are drawn: colours and dashes that no model has."""
    return [
        {"color": SERIES[name][0], "linestyle": dashes, "linewidth": 1.0}
        for name, dashes in zip(("purple", "yellow", "sky"), ("-", *DASHES[4:6]), strict=True)
    ]
