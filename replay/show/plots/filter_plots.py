"""What filter and smoother make of a session: the temperatures that they estimate beside measured and open loop, and
the heat at one node, with its band, beside what the model has there."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from replay.engine.results.run import Filtered, Observed, Run
from replay.show.plots.plots import ROWS, WIDTH, TimeAxis, time_axis
from replay.show.words import words
from replay.show.words.figure import FigureTable, Plot, inline_svg, name_lines, panels, style
from replay.show.words.filter_words import compared, loss, worst_compared
from replay.show.words.palette import COLOURS, DASHES, INK, SOFT, with_variables
from replay.show.words.thin import thin, with_gaps

Floats = NDArray[np.float64]

BAND_SD = 2.0  # the band holds 95 % where the errors are normal
PLAIN = 2.0  # a mean difference of this many standard deviations is said as one
NOTE = (
    "The filter is told where the unknown heat is. Told the wrong node it still finds a history that fits: what it "
    "estimates is no evidence that the cause is there."
)
AFTERWARDS = (
    " Smoothed: from all readings of the session, those after each moment included, so it does not lag; the band is "
    "its own."
)


def estimated_loss(run: Run, columns: int, cause: str | None = None) -> Plot | None:
    """Estimated heat with its band over time, the modelled heat beside it, and the temperatures there below; None
    without a filter.

    `columns` to thin to. `cause`: what the evidence names, in words, where that is not a loss of this node; the title
    then says that the filter blames the wrong place.
    """
    filtered = run.filtered
    if filtered is None:
        return None
    title = _finding(filtered, cause)
    time = time_axis(run)
    with style(f"{run.session} estimated loss"):
        figure, (upper, lower) = panels(WIDTH, (1.6, 1.2))
        _draw_heat(upper, filtered, time, run.t_ns[1:], columns)
        _draw_temperatures(lower, run, filtered, time, columns)
        lower.set_xlim(0, time.of(run.t_ns[-1:])[0])
        lower.set_xlabel(time.label)
        svg = with_variables(inline_svg(figure, title))
    return Plot(title, svg, NOTE + (AFTERWARDS if filtered.smoothed else ""), _table(run, filtered, time))


def _finding(filtered: Filtered, cause: str | None) -> str:
    node, extra = words.name(filtered.node), float((filtered.heat_W - filtered.nominal_W).mean())
    nominal, sd = float(filtered.nominal_W.mean()), float(np.sqrt((filtered.heat_sd_W**2).mean()))
    amount = f"{words.number(round(abs(extra), 1))} W {'more' if extra > 0 else 'less'}"
    beside = (
        f"than the modelled {words.number(round(nominal, 1))} W, ± {words.number(round(BAND_SD * sd, 1))} W at any time"
    )
    if cause is not None:
        return f"Not the {node}: the filter puts {amount} there {beside}, yet the evidence names {cause}"
    if abs(extra) < PLAIN * sd:
        return f"The filter sees no other loss at the {node}: {amount} {beside}"
    return f"The filter puts {amount} loss at the {node} {beside}"


def filter_over_time(run: Run, columns: int) -> Plot | None:
    """Measured, open loop, filter and smoother at the channel that `compared` says first, what each leaves of it, and
    the estimated heat with its band; None without a filter or such a channel. `columns` to thin to."""
    filtered, worst = run.filtered, worst_compared(run.summary)
    channel = next((o for o in run.observed if o.channel == worst and o.node in run.nodes), None)
    if filtered is None or channel is None:
        return None
    title, time = words.capital(compared(run.summary)[0]), time_axis(run)
    with style(f"{run.session} filter over time"):
        figure, (upper, middle, lower) = panels(WIDTH, (1.6, 0.95, 1.2))
        _draw_channel(upper, run, channel, courses(run, filtered, channel), time, columns)
        _draw_left(middle, channel, courses(run, filtered, channel), time, columns)
        _draw_heat(lower, filtered, time, run.t_ns[1:], columns)
        lower.set_xlim(0, time.of(run.t_ns[-1:])[0])
        lower.set_xlabel(time.label)
        svg = with_variables(inline_svg(figure, title))
    note = (
        f"{words.capital(loss(run.summary) or _finding(filtered, None))}. Grey: the sensor's own uncertainty, and two "
        f"standard deviations of the heat. {NOTE}{AFTERWARDS if filtered.smoothed else ''}"
    )
    return Plot(title, svg, note, _channel_table(run, channel, filtered, time))


Courses = list[tuple[str, Floats, str, Any]]  # name, what the channel would have shown (M,), colour, line style


def courses(run: Run, filtered: Filtered, channel: Observed) -> Courses:
    """What a channel would have shown (M,) [degC] by open loop, filter and smoother. All three have the open loop's
    lag."""
    i, t = run.nodes.index(channel.node), run.t_ns

    def as_seen(temperatures: Floats) -> Floats:
        return channel.modelled + np.interp(channel.t_ns, t, temperatures[:, i] - run.temperatures[:, i])

    lines: Courses = [("open loop", channel.modelled, COLOURS[1], DASHES[0])]
    lines.append(("filter", as_seen(filtered.temperatures), COLOURS[0], DASHES[2]))
    if filtered.smoothed:
        lines.append(("smoother", as_seen(filtered.smoothed.temperatures), COLOURS[3], "-"))
    return lines


def _draw_channel(axes: Axes, run: Run, channel: Observed, lines: Courses, time: TimeAxis, columns: int) -> None:
    t, measured = with_gaps(time.of(channel.t_ns), channel.measured, channel.used)
    axes.plot(*thin(t, measured, columns), color=INK[0], linewidth=1.6)
    ends = [(float(channel.measured[-1]), "measured", INK[0])]
    for name, values, colour, dashes in lines:
        t, y = with_gaps(time.of(channel.t_ns), values, np.ones_like(channel.used))
        axes.plot(*thin(t, y, columns), color=colour, linestyle=dashes, linewidth=1.2)
        ends.append((float(values[-1]), name, colour))
    axes.set_ylabel(f"{words.name(channel.node)}\n[°C]")
    name_lines(axes, ends)


def _draw_left(axes: Axes, channel: Observed, lines: Courses, time: TimeAxis, columns: int) -> None:
    """What each estimate leaves of the measured temperature [K]; grey: one standard deviation of the sensor's own."""
    floor = float(np.hypot(channel.sd_K, channel.bias_sd_K))
    axes.axhspan(-floor, floor, color=SOFT[0], alpha=0.22, linewidth=0)
    axes.axhline(0, color=SOFT[0], linewidth=0.8)
    for _, values, colour, dashes in lines:
        t, y = with_gaps(time.of(channel.t_ns), channel.measured - values, channel.used)
        axes.plot(*thin(t, y, columns), color=colour, linestyle=dashes, linewidth=1.1)
    axes.set_ylabel("measured −\neach [K]")


def _channel_table(run: Run, channel: Observed, filtered: Filtered, time: TimeAxis) -> FigureTable:
    i = np.unique(np.linspace(0, channel.t_ns.size - 1, ROWS).astype(np.intp))
    k = np.clip(np.searchsorted(run.t_ns, channel.t_ns[i]) - 1, 0, filtered.heat_W.size - 1)  # the step of each
    best = filtered.smoothed or filtered
    degC = {"measured": channel.measured, **{name: values for name, values, _, _ in courses(run, filtered, channel)}}
    watts = {
        "estimated [W]": filtered.heat_W,
        "modelled [W]": filtered.nominal_W,
        **({"smoothed [W]": filtered.smoothed.heat_W} if filtered.smoothed else {}),
        "standard deviation [W]": best.heat_sd_W,
    }
    head = (time.label, *(f"{name} [°C]" for name in degC), *watts)
    numbers = [*(values[i] for values in degC.values()), *(values[k] for values in watts.values())]
    cells = [[f"{t:.2f}" for t in time.of(channel.t_ns[i])], *([f"{v:.1f}" for v in values] for values in numbers)]
    return FigureTable(head, tuple(zip(*cells, strict=True)))


def _draw_heat(axes: Axes, filtered: Filtered, time: TimeAxis, t_ns: NDArray[np.int64], columns: int) -> None:
    """Smoothed solid, estimated dash-dotted, modelled dashed; grey: two standard deviations of the smoothed heat, else
    of the estimated."""
    t = time.of(t_ns)
    best = filtered.smoothed or filtered
    band = BAND_SD * best.heat_sd_W
    i = np.unique(np.linspace(0, t.size - 1, columns).astype(np.intp))
    axes.fill_between(t[i], (best.heat_W - band)[i], (best.heat_W + band)[i], color=SOFT[0], alpha=0.22, linewidth=0)
    lines = [
        ("estimated", filtered.heat_W, COLOURS[0], DASHES[2]),
        ("modelled", filtered.nominal_W, COLOURS[1], DASHES[0]),
    ]
    if filtered.smoothed:
        lines.append(("smoothed", filtered.smoothed.heat_W, COLOURS[3], "-"))
    ends = []
    for name, watts, colour, dashes in lines:
        axes.plot(*thin(t, watts, columns), color=colour, linestyle=dashes, linewidth=1.2)
        ends.append((float(watts[-1]), name, colour))
    axes.axhline(0, color=SOFT[0], linewidth=0.8)
    axes.set_ylabel(f"loss of the\n{words.name(filtered.node)} [W]")
    name_lines(axes, ends)


def _draw_temperatures(axes: Axes, run: Run, filtered: Filtered, time: TimeAxis, columns: int) -> None:
    """Measured, open loop and filter at the node of the heat; a channel there that the filter did not read checks
    it."""
    i, ends = run.nodes.index(filtered.node), []
    for observed in (o for o in run.observed if o.node == filtered.node):
        measured = with_gaps(time.of(observed.t_ns), observed.measured, observed.used)
        axes.plot(*thin(*measured, columns), color=COLOURS[2], linewidth=1.4)
        name = observed.channel if observed.channel in filtered.measured else f"{observed.channel}, kept"
        ends.append((float(observed.measured[-1]), name, COLOURS[2]))
    lines = [
        (filtered.temperatures, "filtered", COLOURS[0], DASHES[2]),
        (run.temperatures, "open loop", COLOURS[1], DASHES[0]),
    ]
    if filtered.smoothed:
        lines.append((filtered.smoothed.temperatures, "smoothed", COLOURS[3], "-"))
    for temperatures, name, colour, dashes in lines:
        axes.plot(*thin(time.of(run.t_ns), temperatures[:, i], columns), color=colour, linestyle=dashes, linewidth=1.1)
        ends.append((float(temperatures[-1, i]), name, colour))
    axes.set_ylabel("temperature\nthere [°C]")
    name_lines(axes, ends)


def _table(run: Run, filtered: Filtered, time: TimeAxis) -> FigureTable:
    i = np.unique(np.linspace(0, filtered.heat_W.size - 1, ROWS).astype(np.intp))
    node = run.nodes.index(filtered.node)
    head: tuple[str, ...] = (
        time.label,
        "estimated [W]",
        "standard deviation [W]",
        "modelled [W]",
        "filtered [°C]",
        "open loop [°C]",
    )
    watts = (filtered.heat_W[i], filtered.heat_sd_W[i], filtered.nominal_W[i])
    degC = (filtered.temperatures[i + 1, node], run.temperatures[i + 1, node])
    numbers = [*watts, *degC]
    if filtered.smoothed:
        smooth = filtered.smoothed
        head = (*head, "smoothed [W]", "standard deviation smoothed [W]", "smoothed [°C]")
        numbers += [smooth.heat_W[i], smooth.heat_sd_W[i], smooth.temperatures[i + 1, node]]
    cells = [[f"{t:.2f}" for t in time.of(run.t_ns[i + 1])], *([f"{v:.1f}" for v in values] for values in numbers)]
    return FigureTable(head, tuple(zip(*cells, strict=True)))
