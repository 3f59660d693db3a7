"""Where a node's error on kept sessions went: as published, over coefficients and causes, to what is left."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from replay.engine.results.run import Run
from replay.show.plots.plots import WIDTH
from replay.show.reports.kept_errors import furthest_first, replayed
from replay.show.words import words
from replay.show.words.figure import FigureTable, Plot, fitting, inline_svg, style
from replay.show.words.findings import MOVED_K
from replay.show.words.palette import INK, SERIES, SOFT
from replay.studies.diagnosis.answer import ChainStep, Diagnosis, KeptGain

ABREAST, MOST = 3, 6  # nodes beside one another, and drawn at all: the table holds every node
ROW, ABOVE, BELOW = 0.17, 0.24, 0.4  # inches: height of a step's bar, of what is over each block and under the last
ROOM = 1.4  # of the longest bar: its figure stands behind it
LONGEST = 44  # letters of a step's name
PUBLISHED, COEFFICIENTS, CORRECTIONS, LEFT = "as published", "coefficients", "readings' corrections", "what is left"
NOTE = (
    "Mean error on kept sessions, replayed against readings as recorded. Blue: what a step takes; vermillion: what it "
    "adds; grey: what is there before and after."
)
RULER = (
    " Readings' corrections change no temperature of the model: by so much less the last model is off against readings "
    "as its bench file corrects them."
)


@dataclass(frozen=True)
class NodeFall:
    """A node's error [K] after each step, to a tenth: figures that are told add up."""

    node: str
    errors_K: Mapping[str, float]

    @property
    def steps(self) -> Sequence[tuple[str, float, float]]:
        """(step, error before, error after); the first begins at 0."""
        values = list(self.errors_K.values())
        return list(zip(self.errors_K, [0.0, *values[:-1]], values, strict=True))

    @property
    def left_K(self) -> float:
        return list(self.errors_K.values())[-1]


def waterfall(diagnosis: Diagnosis, runs: Mapping[str, Mapping[str, Run]]) -> Plot | None:
    """A panel a node, furthest off as published first. `runs`: session id -> key of MODELS -> run. None where no files
    were replayed over kept sessions."""
    gains = [gain for gain in furthest_first(diagnosis.gain) if replayed(gain)]
    if not gains:
        return None
    last = [list(runs[session].values())[-1] for session in diagnosis.held_out if runs.get(session)]
    terms = _told_of_all(diagnosis, [gain.node for gain in gains])
    falls = _alike([_fall(diagnosis, gain, terms, last) for gain in gains])
    title = _title(falls[0])
    with style(f"{diagnosis.diagnosis} waterfall"):
        svg = inline_svg(_draw(falls[:MOST]), title)
    note = NOTE + (RULER if CORRECTIONS in falls[0].errors_K else "")
    if len(falls) > MOST:
        note += f" Drawn: the {MOST} nodes that were furthest off."
    return Plot(title, svg, note, _table(falls))


def _told_of_all(diagnosis: Diagnosis, nodes: Sequence[str]) -> list[ChainStep]:
    """The terms in the order of entry; [] where a replay with the first of them is lacking for one of the `nodes`."""
    terms = [step for step in diagnosis.chain if step.step > 0]
    return terms if all(set(nodes) <= set(step.kept_mae_K) for step in terms[:-1]) else []


def _fall(diagnosis: Diagnosis, gain: KeptGain, terms: Sequence[ChainStep], last: Sequence[Run]) -> NodeFall:
    known = gain.mae_recorded_K
    errors = {PUBLISHED: known["published"], COEFFICIENTS: known["before"]}
    if "after" in known:
        named = [cause.id for cause in diagnosis.causes]
        final = terms[-1].id if terms else named[0] if len(named) == 1 else f"{len(named)} causes"
        errors |= {f"+ {step.id}": step.kept_mae_K[gain.node] for step in terms[:-1]} | {f"+ {final}": known["after"]}
    errors[CORRECTIONS] = max(list(errors.values())[-1] - _ruler_K(gain.node, last), 0.0)
    return NodeFall(gain.node, {step: round(error, 1) for step, error in errors.items()})


def _ruler_K(node: str, last: Sequence[Run]) -> float:
    """By how much less the last model is off against readings as corrected [K]."""
    errors = [one for run in last for one in run.summary.channels if one.node == node]
    less = [one.mae_recorded_K - one.mae_K for one in errors if one.mae_recorded_K is not None]
    return float(np.mean(less)) if less else 0.0


def _alike(falls: Sequence[NodeFall]) -> list[NodeFall]:
    """Without readings' corrections where they change no node's error by enough to tell."""
    changes = [abs(before - after) for fall in falls for step, before, after in fall.steps if step == CORRECTIONS]
    if max(changes) >= MOVED_K:
        return list(falls)
    return [NodeFall(f.node, {k: v for k, v in f.errors_K.items() if k != CORRECTIONS}) for f in falls]


def _title(fall: NodeFall) -> str:
    """ "Magnet: 10.1 K off as published, coefficients −3.7 K, loss.magnet.speed2 −4.1 K: 2.3 K left"."""
    (_, _, published), *later = fall.steps
    told = [f"{step.removeprefix('+ ')} {words.signed_kelvin(after - before)}" for step, before, after in later]
    node, left = words.capital(words.name(fall.node)), words.kelvin(fall.left_K)
    return f"{node}: {words.kelvin(published)} off as published, {', '.join(told)}: {left} left"


def _draw(falls: Sequence[NodeFall]) -> Figure:
    rows = [*falls[0].errors_K, LEFT]
    blocks = -(-len(falls) // ABREAST)
    high, each = ROW * len(rows), ROW * len(rows) + ABOVE
    whole = each * blocks + BELOW
    figure = Figure(figsize=(WIDTH, whole))
    width, most = 0.62 / ABREAST, ROOM * max(after for fall in falls for _, _, after in fall.steps)
    for i, fall in enumerate(falls):
        block, column = divmod(i, ABREAST)
        low = BELOW + each * (blocks - 1 - block)
        axes = figure.add_axes((0.35 + column * (width + 0.013), low / whole, width, high / whole))
        _draw_node(axes, fall, most)
        axes.set_yticks(range(len(rows)), [fitting(row, LONGEST) for row in rows] if column == 0 else [], fontsize=7.5)
        axes.set_ylim(len(rows) - 0.5, -0.5)
        if i + ABREAST < len(falls):
            axes.tick_params(axis="x", labelbottom=False, length=0)
        else:
            axes.set_xlabel("mean error [K]", fontsize=7.5)
    return figure


def _draw_node(axes: Axes, fall: NodeFall, most: float) -> None:
    axes.set_title(fitting(words.name(fall.node)), fontsize=8, loc="left", pad=3)
    axes.set_xlim(0, most)
    axes.tick_params(axis="y", length=0)
    axes.grid(False, axis="y")
    axes.locator_params(axis="x", nbins=4)
    bars = [*fall.steps, (LEFT, 0.0, fall.left_K)]
    for row, (step, before, after) in enumerate(bars):
        whole = step in (PUBLISHED, LEFT)
        colour = SOFT[0] if whole else SERIES["blue" if after <= before else "vermillion"][0]
        axes.barh(row, after - before, left=before, height=0.66, color=colour)
        axes.text(
            max(before, after) + 0.015 * most,
            row,
            f"{after:.1f}" if whole else words.signed(after - before),
            va="center",
            fontsize=7,
            color=INK[0],
        )
        if not whole:  # where the step before ended
            axes.plot([before, before], [row - 1.33, row + 0.33], color=SOFT[0], linewidth=0.6)


def _table(falls: Sequence[NodeFall]) -> FigureTable:
    steps = list(falls[0].errors_K)
    head = ("node", f"{PUBLISHED} [K]", *(f"{step} [K]" for step in steps[1:]), f"{LEFT} [K]")
    rows = [
        (
            words.name(fall.node),
            f"{fall.errors_K[PUBLISHED]:.1f}",
            *(words.signed(after - before) for _, before, after in fall.steps[1:]),
            f"{fall.left_K:.1f}",
        )
        for fall in falls
    ]
    return FigureTable(head, tuple(rows))
