"""Pictures of lives by a criterion: against temperature as Arrhenius has it, and how many specimens are left."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator

from replay.show.plots.plots import WIDTH
from replay.show.words import words
from replay.show.words.figure import KEY_ABOVE, FigureTable, Plot, inline_svg, style, tick
from replay.show.words.palette import COLOURS, DASHES, INK, SOFT
from replay.studies.ageing.assessment import AssessedLives, OneLife

ZERO_DEGC_IN_K = 273.15
REFERENCE_DEGC, INDEX_H = 180.0, 20_000.0  # of the law's median, of a temperature index (IEC 60216)
APART = 0.35  # K on the axis between specimens of one oven
HIGH = 3.2  # inches


def arrhenius(life: AssessedLives, key: str) -> Plot | None:
    """Lives over temperature, arrows upwards where the criterion was not met yet, with the law where they tell one;
    None without lives."""
    if not life.lives:
        return None
    title = _title(life)
    with style(f"{key} arrhenius"):
        figure = Figure(figsize=(WIDTH, HIGH))
        ax = figure.add_axes((0.1, 0.15, 0.87, 0.75))
        ax.set_yscale("log")
        for group in _by_temperature(life.lives).values():
            for i, one in enumerate(group):
                _draw_life(ax, one, one.degC + APART * (i - (len(group) - 1) / 2))
        _draw_law(ax, life)
        temperatures = sorted({one.degC for one in life.lives} | ({REFERENCE_DEGC} if life.law else set()))
        ax.set_xticks([_place(degC) for degC in temperatures], [f"{degC:g}" for degC in temperatures])
        ax.set_xlim(_place(temperatures[0] - 6), _place(temperatures[-1] + 6))
        ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        ax.yaxis.set_minor_locator(NullLocator())
        ax.yaxis.set_major_formatter(tick)
        ax.set_xlabel("temperature of the dose [°C], as 1/T")
        ax.set_ylabel("life [h]")
        if life.law:
            ax.legend(**KEY_ABOVE, ncols=2)
        svg = inline_svg(figure, title)
    note = f"Life by {life.criterion.replace('-', '−')}. Bar: met between two checks. Arrow: not yet at the last."
    return Plot(title, svg, f"{note} {words.capital(life.why)}." if life.why else note, _table(life))


def _title(life: AssessedLives) -> str:
    ended = sum(one.upper_h is not None for one in life.lives)
    of = words.counted(len(life.lives), "specimen")
    if life.law is None:
        return f"{ended} of {of} met the end of life: no law can be told yet"
    energy = life.law.activation_energy_eV
    return (
        f"Lives go with {energy['value']:.2f} eV: {ended} of {words.counted(len(life.lives), 'specimen')} met their end"
    )


def _place(degC: float) -> float:
    """On an axis of 1/T, the hotter at the right."""
    return -1000.0 / (degC + ZERO_DEGC_IN_K)


def _by_temperature(lives: Sequence[OneLife]) -> dict[float, list[OneLife]]:
    return {degC: [one for one in lives if one.degC == degC] for degC in sorted({one.degC for one in lives})}


def _draw_life(ax: Axes, one: OneLife, degC: float) -> None:
    x, low = _place(degC), max(one.lower_h, 1.0)
    if one.upper_h is None:
        ax.annotate(
            "", (x, 1.9 * low), (x, low), arrowprops={"arrowstyle": "->", "color": COLOURS[1], "linewidth": 1.0}
        )
        ax.plot(x, low, marker="o", markersize=3.5, color=COLOURS[1], markerfacecolor="none")
        ax.plot(x, 1.9 * low, alpha=0.0)  # room for the arrow
        return
    ax.plot([x, x], [low, max(one.upper_h, low)], color=COLOURS[0], linewidth=1.2, marker="_", markersize=5)


def _draw_law(ax: Axes, life: AssessedLives) -> None:
    from analytics.insulation.dose.arrhenius import BOLTZMANN_EV_PER_K

    if life.law is None:
        return
    coolest = min([REFERENCE_DEGC, *(one.degC for one in life.lives)])
    degC = np.linspace(coolest - 4, max(one.degC for one in life.lives) + 4, 60)
    kelvin = 1 / (degC + ZERO_DEGC_IN_K) - 1 / (REFERENCE_DEGC + ZERO_DEGC_IN_K)
    median = life.law.median_h_at_180degC
    hours = median["value"] * np.exp(life.law.activation_energy_eV["value"] / BOLTZMANN_EV_PER_K * kelvin)
    ax.plot([_place(one) for one in degC], hours, color=INK[0], label=f"median life, {life.law.distribution}")
    low, high = (median["value"] if end is None else end for end in median["ci95"])
    at = _place(REFERENCE_DEGC)
    ax.plot([at, at], [low, high], color=INK[0], linewidth=3, alpha=0.4, label="its 95 % at 180 °C")
    if life.law.temperature_index_degC:
        ax.axhline(INDEX_H, color=SOFT[0], linewidth=0.8, linestyle=(0, (5, 2)))


def _table(life: AssessedLives) -> FigureTable:
    rows = [
        (
            one.specimen,
            f"{one.degC:g}",
            f"{one.lower_h:,.0f}",
            "not yet" if one.upper_h is None else f"{one.upper_h:,.0f}",
        )
        for one in life.lives
    ]
    return FigureTable(("specimen", "temperature [°C]", "not met at [h]", "met for sure at [h]"), tuple(rows))


def survival(life: AssessedLives, key: str) -> Plot | None:
    """Which share of the specimens of each temperature had not met the criterion, over the dose: between what is sure
    and what may be. None where none met it."""
    ended = [one for one in life.lives if one.upper_h is not None]
    if not ended:
        return None
    first = min(ended, key=lambda one: one.upper_h or math.inf)
    title = f"The first specimen met the end of life by {first.upper_h:,.0f} h, at {first.degC:g} °C"
    last = 1.05 * max([one.upper_h or one.lower_h for one in life.lives])
    groups = list(_by_temperature(life.lives).items())[: len(COLOURS)]
    with style(f"{key} survival"):
        figure = Figure(figsize=(WIDTH, HIGH))
        ax = figure.add_axes((0.1, 0.15, 0.87, 0.75))
        for (degC, group), colour, dashes in zip(groups, COLOURS, DASHES, strict=False):
            dose, sure, perhaps = left(group, last)
            ax.fill_between(dose, 100 * sure, 100 * perhaps, step="post", color=colour, alpha=0.18, linewidth=0)
            ax.step(dose, 100 * sure, where="post", color=colour, linestyle=dashes, label=f"{degC:g} °C")
        ax.set_ylim(0, 104)
        ax.set_xlim(0, last)
        ax.set_xlabel("dose [h]")
        ax.set_ylabel("not at the end of life [%]")
        ax.legend(**KEY_ABOVE, ncols=7)
        svg = inline_svg(figure, title)
    note = (
        f"End of life: {life.criterion.replace('-', '−')}. Line: surely not met yet. Band: perhaps not. "
        "Between checks, and behind the last one, nothing is known."
    )
    rows = [
        (f"{degC:g}", f"{h:,.0f}", f"{100 * low:.0f}", f"{100 * high:.0f}")
        for degC, group in groups
        for h, low, high in zip(*left(group, last), strict=True)
    ]
    return Plot(
        title, svg, note, FigureTable(("temperature [°C]", "dose [h]", "surely left [%]", "perhaps [%]"), tuple(rows))
    )


def left(lives: Sequence[OneLife], last_h: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Doses [h] at which something changes (m,), the share that surely had not met the criterion from there on, and the
    share that may not have."""
    ends = [end for one in lives for end in (one.lower_h, one.upper_h) if end is not None]
    dose = np.unique([0.0, *ends, last_h])
    sure = np.array([np.mean([one.lower_h > at for one in lives]) for at in dose])
    perhaps = np.array([np.mean([one.upper_h is None or one.upper_h > at for one in lives]) for at in dose])
    return dose, sure, perhaps
