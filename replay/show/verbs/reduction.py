"""How many nodes a motor needs: the curve of nodes against error, as a table for the terminal and as a picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullLocator

from replay.show.words import words
from replay.show.words.figure import save_svg, style, tick
from replay.show.words.palette import COLOURS, DASHES, INK, PAPER, SOFT

SMALLER = 0.92  # a row of the table has at most this share of the nodes of the row above
ENOUGH_K = (0.5, 1.0, 2.0)


def reduction_text(data: Mapping[str, Any]) -> str:
    """Lines for a person, from the answer's data."""
    curve = data["curve"]
    kept = curve[0]["kept"] is not None
    chosen = f", mergers chosen on {words.joined(data['hold_out'])}" * kept
    merged = f"{data['motor']}: {curve[0]['nodes']} nodes merged to {data['nodes']}"
    lines = [f"{merged}, by its own run on {words.joined(data['on'])}{chosen}"]
    lines.append(f"errors at     {_interest(data['interest'])}")
    head = "nodes   mean K   at most K" + "   kept: mean K   at most K" * kept
    lines += ["", head, *(_row(level, data["nodes"], kept) for level in _thinned(curve, data["nodes"]))]
    lines += ["", *_enough(curve, "kept" if kept else "trained")]
    if data["within_K"] is not None:
        fewest = f"{data['nodes']} nodes are the fewest within {data['within_K']:g} K that keep measured nodes apart"
        lines.append(f"{fewest}: for another number say --to")
    return "\n".join(lines)


def _interest(interest: Mapping[str, str]) -> str:
    measured = sum(why.startswith("measured") for why in interest.values())
    hottest = [f"{node} ({why.removeprefix('measured, ')})" for node, why in interest.items() if "hottest" in why]
    return "; ".join(filter(None, [words.counted(measured, "measured node"), words.joined(hottest)]))


def _row(level: Mapping[str, Any], chosen: int, kept: bool) -> str:
    found, other = level["trained"], level["kept"]
    row = f"{level['nodes']:5}   {found['mean_K']:6.2f}   {found['largest_K']:9.1f}"
    row += f"   {other['mean_K']:12.2f}   {other['largest_K']:9.1f}" if kept else ""
    return f"{row}   <- written" if level["nodes"] == chosen else row


def _thinned(curve: Sequence[Mapping[str, Any]], chosen: int) -> list[Mapping[str, Any]]:
    rows: list[Mapping[str, Any]] = []
    for level in curve:
        if not rows or level["nodes"] <= SMALLER * rows[-1]["nodes"] or level["nodes"] == chosen or level is curve[-1]:
            rows.append(level)
    return rows


def _enough(curve: Sequence[Mapping[str, Any]], side: str) -> list[str]:
    """In words, the fewest nodes that stay within each mean error of `ENOUGH_K`; nothing where none does."""
    found = []
    for limit in ENOUGH_K:
        good = [level["nodes"] for level in curve if level[side]["mean_K"] <= limit]
        found += [f"{min(good)} nodes stay within {limit:g} K"] if good else []
    return [f"on average {words.joined(found)}"] if found else []


def draw_curve(data: Mapping[str, Any], target: Path) -> None:
    """The curve as an SVG file; the same data give the same bytes."""
    curve = data["curve"]
    sizes = [level["nodes"] for level in curve]
    with style(data["motor"]):
        figure = Figure(figsize=(6.2, 3.6), facecolor=PAPER[0])
        axes = figure.add_axes((0.09, 0.14, 0.88, 0.74))
        sides = [("trained", "sessions that it was merged by"), ("kept", "kept sessions, which chose the mergers")]
        for (side, label), colour, dashes in zip(sides, COLOURS, ("-", DASHES[0]), strict=False):
            if curve[0][side] is not None:
                errors = [level[side]["mean_K"] for level in curve]
                axes.plot(sizes, errors, color=colour, linestyle=dashes, marker="o", markersize=2.5, label=label)
        at = next(level for level in curve if level["nodes"] == data["nodes"])
        axes.axvline(data["nodes"], color=SOFT[0], linewidth=0.8)
        place = (data["nodes"], 1)
        axes.annotate(f" {data['nodes']} nodes", place, xycoords=("data", "axes fraction"), va="top", color=INK[0])
        axes.set_xscale("log")
        ticks = [size for size in (2, 3, 5, 10, 20, 50, 100, 200, 500, 1000) if sizes[-1] <= size <= sizes[0]]
        axes.xaxis.set_major_locator(FixedLocator(ticks))
        axes.xaxis.set_minor_locator(NullLocator())
        axes.xaxis.set_major_formatter(tick)
        axes.set_ylim(bottom=0)
        axes.set_xlabel("nodes")
        axes.set_ylabel("mean error against all nodes [K]")
        axes.legend(loc="upper right", frameon=False, borderpad=0)
        error, where = (at["kept"] or at["trained"])["mean_K"], "kept sessions" if at["kept"] else "its own sessions"
        title = f"{data['motor']}: {data['nodes']} of {sizes[0]} nodes are {error:.2f} K off on {where}"
        axes.set_title(title, loc="left", fontsize=9.5)
        save_svg(figure, target)
