"""Pictures of ageing: each specimen's course with the fitted form, and how fast specimens and batches deteriorate."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from replay.show.plots.plots import WIDTH
from replay.show.words import words
from replay.show.words.courses import form
from replay.show.words.figure import BEHIND, FigureTable, Plot, fitting, inline_svg, style, tick
from replay.show.words.palette import COLOURS, INK, SOFT
from replay.studies.ageing.assessment import Assessment, Batch, Density, Specimen

Floats = NDArray[np.float64]

CRITERION_PERCENT = 200.0  # conductivity -50 %: R is twice the first
SEEN_FROM = 133.0  # percent of the first R: below, the criterion is told and not drawn, it would flatten the courses
MOST_COURSES, COLUMNS = 8, 2
MOST_ROWS = 60  # specimens in the forest
MOST_NAMED = 5  # specimens or batches in its title
DENSITY = 3.0  # inches
FEWEST = 0.05  # of the fullest column's: where fewer checks lie, they are not made to look like many
SHADES = (0.02, 0.1, 0.25, 0.5, 0.75)  # of the fullest cell
DENSITY_NOTE = (
    "The darker, the more of the checks at that dose; the line is their median. The table has a row a column of the "
    "picture."
)
PANEL, ROW = 1.75, 0.17  # inches: height of a course's panel, of a specimen in the forest


def points(one: Specimen) -> list[tuple[float, float, float]]:
    """(dose [h], R in % of the first, its sd) of each check that has both."""
    found = [(check.dose_h, check.resistance_K_per_W, check.sd_percent) for check in one.checks]
    known = [(dose, r, sd) for dose, r, sd in found if dose is not None and r is not None and sd is not None]
    first = first_resistance(one)
    return [(dose, 100 * r / first, sd * r / first) for dose, r, sd in known]


def first_resistance(one: Specimen) -> float:
    """R [K/W] of the first check whose R and dose are known, 1 where there is none."""
    known = (check for check in one.checks if check.sd_percent is not None and check.dose_h is not None)
    return next((check.resistance_K_per_W for check in known if check.resistance_K_per_W), 1.0)


def most_telling(specimens: Sequence[Specimen]) -> list[Specimen]:
    """Those that stand out first, then those that change, then the fastest."""
    return sorted(specimens, key=lambda one: (not one.outlying, not one.significant, -(one.score or 0.0)))


def courses(found: Assessment, title: str) -> Plot | None:
    """R over the dose of those that tell most, a panel each, with the fitted form and its band; None without checks."""
    drawn = [one for one in most_telling(found.specimens) if points(one)][:MOST_COURSES]
    if not drawn:
        return None
    top = max(percent + 2 * sd for one in drawn for _, percent, sd in points(one))
    rows = -(-len(drawn) // COLUMNS)
    with style(f"{found.assessment} courses"):
        figure = Figure(figsize=(WIDTH, PANEL * rows + 0.5))
        grid = figure.subplots(rows, COLUMNS, sharex=True, sharey=True, squeeze=False)
        high = PANEL * rows + 0.5
        figure.subplots_adjust(0.1, 0.45 / high, 0.985, 1 - 0.28 / high, wspace=0.08, hspace=0.3)
        for ax in grid.flat[len(drawn) :]:
            ax.remove()
        for i, (ax, one) in enumerate(zip(grid.flat, drawn, strict=False)):
            _draw_course(ax, one)
            if top > SEEN_FROM:
                ax.axhline(CRITERION_PERCENT, color=COLOURS[1], linewidth=0.9, linestyle=(0, (5, 2)))
            if i + COLUMNS >= len(drawn):
                ax.tick_params(labelbottom=True)
                ax.set_xlabel(f"hours above {found.threshold_degC:g} °C")
                ax.xaxis.set_major_formatter(tick)
        figure.text(0.012, 0.5, "R, % of the first", rotation=90, va="center")
        svg = inline_svg(figure, title)
    left = len(found.specimens) - len(drawn)
    note = (
        "Bars: two standard deviations of a check, repeatability included. Line and grey band: the most probable form "
        f"and its 95 %. Dotted: where the course changes. {_criterion(found, top)}"
    )
    return Plot(title, svg, note + (f" {left} more specimens in the table." if left else ""), _courses_table(found))


def density(found: Assessment) -> Plot | None:
    """Where the checks of a whole fleet lie, as a density; None where its courses can be told apart."""
    if found.whole.density is None:
        return None
    title = f"All {found.whole.specimens:,} specimens: where their {found.whole.checks:,} checks lie"
    with style(f"{found.assessment} density"):
        figure = Figure(figsize=(WIDTH, DENSITY))
        ax = figure.add_axes((0.1, 0.16, 0.88, 0.8))
        draw_density(ax, found.whole.density)
        ax.set_xlabel(f"hours above {found.threshold_degC:g} °C")
        ax.xaxis.set_major_formatter(tick)
        ax.set_ylabel("R, % of the first")
        svg = inline_svg(figure, title)
    return Plot(title, svg, DENSITY_NOTE, _density_table(found.whole.density))


def draw_density(ax: Axes, density: Density) -> None:
    """Each column of doses in shades of its own fullest cell, as late checks are few, with the median course."""
    checks = np.array(density.checks, np.float64)
    share = checks / np.maximum(checks.max(axis=0), FEWEST * checks.max())
    levels = [*SHADES, 1.01]
    alphas = [shade**0.5 * 0.8 for shade in SHADES]
    cells = (_middles(density.dose_h), _middles(density.percent), share)
    for low, high, alpha in zip(levels, levels[1:], alphas, strict=False):
        ax.contourf(*cells, levels=[low, high], colors=[COLOURS[0]], alpha=alpha)
    ax.plot(_middles(density.dose_h), _quantiles(density)[1], color=INK[0], linewidth=1.2)
    ax.grid(False)


def _middles(edges: Sequence[float]) -> Floats:
    return np.asarray((np.array(edges[1:]) + np.array(edges[:-1])) / 2, np.float64)


def _quantiles(density: Density) -> Floats:
    """R [% of the first] below which 10 %, half and 90 % of the checks of each column of doses lie (3, n); NaN where
    there is none."""
    below = np.cumsum(np.array(density.checks, np.float64), axis=0)
    edges, found = np.array(density.percent), np.full((3, below.shape[1]), np.nan)
    for column, total in enumerate(below[-1]):
        if total:
            at = np.array([0.1, 0.5, 0.9]) * total
            found[:, column] = np.interp(at, np.concatenate([[0.0], below[:, column]]), edges)
    return found


def _density_table(density: Density) -> FigureTable:
    head = ("dose [h]", "checks", "R of 10 % is below [% of the first]", "median [%]", "R of 90 % is below [%]")
    counts = np.array(density.checks).sum(axis=0)
    rows = zip(_middles(density.dose_h), counts, *_quantiles(density), strict=True)
    shown = [(_cell(dose), f"{n:,}", *(_cell(percent) for percent in rest)) for dose, n, *rest in rows if n]
    return FigureTable(head, tuple(shown))


def _criterion(found: Assessment, top: float) -> str:
    place = "dashed at" if top > SEEN_FROM else "far above these,"
    criterion = found.criterion.replace("-", "−")
    return f"The end of life by {criterion} is {place} {CRITERION_PERCENT:.0f} %."


def _draw_course(ax: Axes, one: Specimen) -> None:
    dose, percent, sd = (np.array(column) for column in zip(*points(one), strict=True))
    if one.fitted:
        scale = 100 / first_resistance(one)
        low, middle, high = (scale * np.array(one.fitted[end]) for end in ("low", "resistance_K_per_W", "high"))
        ax.fill_between(one.fitted["dose_h"], low, high, color=SOFT[0], alpha=0.28, linewidth=0)
        ax.plot(one.fitted["dose_h"], middle, color=INK[0], linewidth=1.2)
    ax.errorbar(dose, percent, yerr=2 * sd, fmt="o", color=COLOURS[0], markersize=3, elinewidth=0.7, capsize=2)
    if one.change_at_dose_h is not None and one.significant:
        ax.axvline(one.change_at_dose_h, color=INK[0], linewidth=0.7, linestyle=(0, (1, 2)))
    batch = f" ({one.batch})" if one.batch else ""
    name = fitting(f"{one.specimen}{batch}", 18)
    says = "too few checks" if not one.fitted else form(one) if one.significant else "no change seen"
    ax.set_title(f"{name}: {says}", fontsize=8.5, loc="left", pad=3)


def _courses_table(found: Assessment) -> FigureTable:
    head = ("specimen", "batch", "dose [h]", "R [K/W]", "its sd [%]", "R, % of the first", "R by", "why there is none")
    rows = []
    for one in found.specimens:
        first = first_resistance(one)
        for check in one.checks:
            r = check.resistance_K_per_W
            rows.append(
                (
                    one.specimen,
                    one.batch or "",
                    _cell(check.dose_h),
                    "–" if r is None else f"{r:.4g}",
                    _cell(check.sd_percent),
                    _cell(None if r is None else 100 * r / first),
                    check.from_ or "",
                    check.why or "",
                )
            )
    return FigureTable(head, tuple(rows))


def forest(found: Assessment) -> Plot | None:
    """The slope of every specimen with its interval, by batch; None below two specimens with a slope."""
    known = [one for one in found.specimens if one.fleet_slope_percent_per_100h is not None]
    if len(known) < 2:
        return None
    batches: dict[str | None, Batch] = {one.batch: one for one in found.batches}
    shown = sorted(most_telling(known)[:MOST_ROWS], key=lambda one: _place(one, batches))
    title = _forest_title(found)
    high = ROW * (len(shown) + len(batches)) + 0.75
    with style(f"{found.assessment} forest"):
        figure = Figure(figsize=(WIDTH, high))
        ax = figure.add_axes((0.2, 0.42 / high, 0.77, 1 - 0.55 / high))
        labels = _draw_forest(ax, shown, batches)
        ax.set_yticks(range(len(labels)), labels, fontsize=7)
        ax.set_ylim(len(labels) - 0.4, -0.6)
        ax.grid(False, axis="y")
        ax.tick_params(axis="y", length=0)
        ax.axvline(0.0, color=INK[0], linewidth=0.7)
        ax.set_xlabel(f"change of R per 100 h above {found.threshold_degC:g} °C [%]")
        svg = inline_svg(figure, title)
    note = (
        "Dots: a specimen's slope from its last check on, as its own checks and those of its fleet say together, with "
        "95 %. Diamonds: the mean slope of a batch over all its checks, which is another where courses bend, with how "
        "far it is above the other batches in standard deviations; how many specimens it has stands behind its name. "
        "Orange: stands out."
    )
    left = found.whole.specimens - len(shown)
    return Plot(title, svg, note + (f" {left:,} more are not drawn." if left else ""), _forest_table(known, batches))


def _forest_title(found: Assessment) -> str:
    batches = [f"batch {one.batch}" for one in found.batches if one.outlying]
    names = batches or [one.specimen for one in found.specimens if one.outlying]
    many = len(batches) or found.whole.outlying
    if not many:
        return "No specimen deteriorates faster than the others beyond chance"
    what = words.joined(names) if many <= MOST_NAMED else f"{many:,} {'batches' if batches else 'specimens'}"
    return f"{words.capital(what)} {'deteriorates' if many == 1 else 'deteriorate'} faster than the others"


def _place(one: Specimen, batches: Mapping[str | None, Batch]) -> tuple[float, str, float]:
    """The worst batch first, its fastest specimen first."""
    batch = batches.get(one.batch)
    score = batch.score if batch else None
    return -(score or 0.0), one.batch or "", -(one.fleet_slope_percent_per_100h or 0.0)


def _draw_forest(ax: Axes, shown: Sequence[Specimen], batches: Mapping[str | None, Batch]) -> list[str]:
    """A row a specimen under its batch; the names of the rows."""
    labels: list[str] = []
    before: str | None = None
    for one in shown:
        batch = batches.get(one.batch)
        if batch and one.batch != before and batch.slope_percent_per_100h is not None:
            colour = COLOURS[1] if batch.outlying else INK[0]
            ax.plot(batch.slope_percent_per_100h, len(labels), marker="D", markersize=6, color=colour)
            if batch.score is not None:
                says = f"{words.signed(batch.score)} sd"
                ax.annotate(says, (batch.slope_percent_per_100h, len(labels)), **BEHIND | {"xytext": (7, 0)})
            labels.append(fitting(f"batch {batch.batch}, {batch.specimens}", 20))
        before = one.batch
        slope, sd = one.fleet_slope_percent_per_100h or 0.0, one.fleet_slope_sd or 0.0
        colour = COLOURS[1] if one.outlying else COLOURS[0]
        ax.errorbar(slope, len(labels), xerr=1.96 * sd, fmt="o", color=colour, markersize=3, elinewidth=0.8)
        labels.append(fitting(one.specimen, 20))
    return labels


def _forest_table(known: Sequence[Specimen], batches: Mapping[str | None, Batch]) -> FigureTable:
    head = ("specimen", "batch", "R per 100 h [%]", "sd [%]", "above its fleet [sd]", "batch above the others [sd]")
    rows = [
        (
            one.specimen,
            one.batch or "",
            _cell(one.fleet_slope_percent_per_100h),
            _cell(one.fleet_slope_sd),
            _cell(one.score),
            _cell(batches[one.batch].score if one.batch in batches else None),
        )
        for one in sorted(known, key=lambda one: _place(one, batches))
    ]
    return FigureTable(head, tuple(rows))


def _cell(value: float | None) -> str:
    """A number in a table; a dash where there is none. What rounds to nothing has no sign."""
    return "–" if value is None else words.fixed(value)
