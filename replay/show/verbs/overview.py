"""Many replays in a few lines: a row a recording, a column a node, and where the largest error of each is."""

from __future__ import annotations

from collections.abc import Sequence

from ingest.texts.cells import cell, places
from replay.engine.results.summary import Summary
from replay.show.words import words
from replay.show.words.findings import answer, direction, worst_first
from replay.show.words.terminal import INDENT, labelled


def overview(summaries: Sequence[Summary]) -> list[str]:
    """The answer in a sentence, then mean absolute errors [K] by recording and node."""
    nodes = list(dict.fromkeys(node for summary in summaries for node in summary.mae_K))
    wide = max((places(summary.session_name) for summary in summaries), default=0)
    head = " " * (wide + 12) + "".join(f"{words.name(node):>9}" for node in nodes)
    return [
        *labelled("What is wrong", answer(summaries)),
        "",
        " " * INDENT + head + "   mean error, and the largest",
        *(" " * INDENT + _row(summary, nodes, wide) for summary in summaries),
    ]


def _row(summary: Summary, nodes: Sequence[str], wide: int) -> str:
    errors = worst_first(summary)
    figures = "".join(f"{summary.mae_K[node]:>7.1f} K" if node in summary.mae_K else " " * 9 for node in nodes)
    lead = f"{cell(summary.session_name, wide)}{words.duration(summary.duration_s):>12}{figures}   "
    if not errors:
        return lead + "no node is observed"
    if all(error.within_floor for error in errors):
        return lead + "all within the sensors' own uncertainty"
    worst = errors[0]
    return lead + f"{words.name(worst.node)} {direction(worst)}, up to {words.kelvin(worst.max_K)}"
