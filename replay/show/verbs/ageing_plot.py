"""The courses of R over the dose, as a picture."""

from __future__ import annotations

import textwrap
from pathlib import Path

from matplotlib.figure import Figure

from replay.show.plots.ageing_plots import draw_density, points
from replay.show.verbs.ageing import answer, score
from replay.show.words.figure import KEY_ABOVE, save, style
from replay.show.words.palette import COLOURS, DASHES, INK, PAPER, SOFT
from replay.studies.ageing.assessment import Assessment


def picture(found: Assessment, target: Path) -> None:
    """R of every specimen over its dose, of its first value, on white: `target` with the suffixes .svg and .png."""
    with style("ageing"):
        figure = Figure(figsize=(9.0, 5.0), facecolor=PAPER[0])
        axes = figure.add_axes((0.08, 0.13, 0.89, 0.70))
        drawn = [one for one in found.specimens if points(one)]
        coloured = sorted(drawn, key=lambda one: (not one.outlying, not one.significant, score(one)))[: len(COLOURS)]
        if found.whole.density:
            draw_density(axes, found.whole.density)
        for one in drawn:
            if one not in coloured and not found.whole.density:
                dose, percent, _ = zip(*points(one), strict=True)
                axes.plot(dose, percent, color=SOFT[0], alpha=0.25, linewidth=0.6)
        for one, colour, dashes in zip(coloured, COLOURS, DASHES, strict=False):
            dose, percent, sd = zip(*points(one), strict=True)
            axes.errorbar(
                dose, percent, yerr=[2 * s for s in sd], color=colour, linestyle=dashes, marker="o", markersize=3,
                elinewidth=0.7, capsize=2, label=f"{one.specimen}{'' if one.batch is None else f' ({one.batch})'}",
            )  # fmt: skip
            if one.change_at_dose_h is not None and one.significant:
                axes.axvline(one.change_at_dose_h, color=colour, linewidth=0.6, linestyle=dashes)
        axes.axhline(100.0, color=INK[0], linewidth=0.6)
        axes.set_xlabel(f"hours above {found.threshold_degC:g} °C")
        axes.set_ylabel("thermal resistance, % of the first")
        if coloured:
            axes.legend(**KEY_ABOVE, ncols=6)
        said = textwrap.shorten(answer(found), 190, placeholder=" ...")
        figure.text(0.08, 0.95, textwrap.fill(said, 105), fontsize=8.5, fontweight="bold", va="center")
        note = "bars: two standard deviations, repeatability included; vertical lines: where a course changes"
        figure.text(0.08, 0.015, note, fontsize=6.5, color=SOFT[0])
        save(figure, target)
