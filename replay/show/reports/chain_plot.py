"""The chain of a diagnosis as falling bars: mean error a step, on sessions left out of learning and on kept ones."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from replay.show.plots.plots import WIDTH
from replay.show.reports import steps
from replay.show.reports.gain_plot import cell
from replay.show.words import words
from replay.show.words.figure import BEHIND, KEY_ABOVE, FigureTable, Plot, inline_svg, style
from replay.show.words.palette import INK, KEPT, LEARNT
from replay.studies.diagnosis.answer import ChainStep, Diagnosis

ROW, MARGIN = 0.5, 0.75  # inches: height of a step's bars, of what is above and below
ROOM = 1.15  # of the longest bar: its figure stands behind it
READING = (
    "Bars: mean error over the nodes, of each session learnt from, predicted from the others, and of kept sessions, "
    "replayed against readings as recorded. As published nothing is learnt, so nothing is left out."
)


def chain_bars(diagnosis: Diagnosis) -> Plot | None:
    """Two bars a step, from the file as published to the last term. None where no term was let in."""
    chain = diagnosis.chain
    if not any(step.id for step in chain):
        return None
    title = _title(chain)
    with style(f"{diagnosis.diagnosis} chain"):
        svg = inline_svg(_draw(chain), title)
    return Plot(title, svg, READING, _table(chain))


def _title(chain: Sequence[ChainStep]) -> str:
    """With the recalibrated model, which may predict sessions better than terms do."""
    first, last = chain[0], chain[-1]
    told = [first, next(step for step in chain if step.step == 0), last]
    before, between, after = words.figures([steps.mean_K(step.left_out_mae_K) for step in told])
    terms = words.counted(last.step, "term")
    return (
        f"A session predicted from the others: {before} K off as published, {between} K recalibrated, {after} K with "
        f"{terms} more"
    )


def _draw(chain: Sequence[ChainStep]) -> Figure:
    height = ROW * len(chain) + MARGIN
    figure = Figure(figsize=(WIDTH, height))
    axes = figure.add_axes((0.36, 0.42 / height, 0.6, ROW * len(chain) / height))
    rows = np.arange(len(chain))
    of_kept = [step.kept_mae_K for step in chain]
    drawn = [(-0.17, [step.left_out_mae_K for step in chain], LEARNT, "predicted from the others")]
    drawn += [(0.17, of_kept, KEPT, "kept")] if any(of_kept) else []
    for shift, errors, colour, label in drawn:
        values = [steps.mean_K(one) if one else 0.0 for one in errors]
        axes.barh(rows + shift, values, height=0.3, color=colour, label=label)
        for row, value in zip(rows, values, strict=True):
            if value:
                axes.annotate(f"{value:.2f}", (value, row + shift), color=INK[0], **BEHIND)
    axes.set_yticks(rows, [_label(step) for step in chain])
    axes.invert_yaxis()
    axes.grid(False, axis="y")
    axes.tick_params(axis="y", length=0)
    axes.set_xlim(0, ROOM * axes.get_xlim()[1])
    axes.set_xlabel("mean error [K]")
    axes.legend(**KEY_ABOVE, ncols=2, handlelength=1.2)
    return figure


def _label(step: ChainStep) -> str:
    return words.capital(steps.called(step)) if step.step < 1 else f"+ {step.id}"


def _table(chain: Sequence[ChainStep]) -> FigureTable:
    nodes = list(chain[0].left_out_mae_K)
    head = ("step", "ln BF", "sessions better", *(f"{words.name(n)}, left out [K]" for n in nodes))
    head += tuple(f"{words.name(n)}, kept [K]" for n in nodes if any(n in step.kept_mae_K for step in chain))
    rows = []
    for step in chain:
        evidence = "–" if step.log_bayes_factor is None else words.digits(step.log_bayes_factor)
        better = f"{step.sessions_better} of {step.sessions}" if step.step >= 0 else "–"
        kept = [cell(step.kept_mae_K.get(n)) for n in nodes if any(n in other.kept_mae_K for other in chain)]
        rows.append((_label(step), evidence, better, *(cell(step.left_out_mae_K.get(n)) for n in nodes), *kept))
    return FigureTable(head, tuple(rows))
