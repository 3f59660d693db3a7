"""What filter and smoother make of a session: temperatures beside measured and open loop, and the heat at one node."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from replay.engine.results.run import Filtered, Observed, Run
from replay.show.plots.plots import (
    SMALL,
    WIDTH,
    TimeAxis,
    around_zero,
    draw,
    instants,
    over_driving,
    strip,
    time_axis,
)
from replay.show.words import words
from replay.show.words.figure import BAND, MOVING, FigureTable, Plot, inline_svg, name_lines, named, panels, style
from replay.show.words.filter_words import compared, loss, worst_compared
from replay.show.words.palette import COLOURS, DASHES, INK, SOFT

Floats = NDArray[np.float64]

BAND_SD = 2.0  # the band holds 95 % where the errors are normal
PLAIN = 2.0  # a mean difference of this many standard deviations is said as one
READING = (  # said once for all sessions
    "The filter is told where the unknown heat is. Told the wrong node it still finds a history that fits: what it "
    "estimates is no evidence that the cause is there. Smoothed: from all readings of the session, those after each "
    "moment included, so it does not lag. Grey about the heat: two standard deviations."
)


def estimated_loss(run: Run, columns: int, cause: str | None = None) -> Plot | None:
    """Estimated heat with its band over time, the modelled heat beside it, and the temperatures there below; None
    without a filter. `columns` to thin to; `cause`: what the evidence names, in words, where that is not a loss of this
    node: the title then says that the filter blames the wrong place."""
    filtered = run.filtered
    if filtered is None:
        return None
    title = _finding(filtered, cause)
    time = time_axis(run)
    with style(f"{run.session} estimated loss"):
        figure, (upper, lower, *below) = panels(WIDTH, (1.2, 0.8, *strip(run)), top=0.08)
        _draw_heat(upper, filtered, time, run.t_ns[1:], columns)
        _draw_temperatures(lower, run, filtered, time, columns)
        over_driving(lower, below, run, columns)
        svg = inline_svg(figure, title)
    return Plot(title, svg, "", _table(run, filtered, time))


def _finding(filtered: Filtered, cause: str | None) -> str:
    node, extra = words.name(filtered.node), float((filtered.heat_W - filtered.nominal_W).mean())
    nominal, sd = float(filtered.nominal_W.mean()), float(np.sqrt((filtered.heat_sd_W**2).mean()))
    size, modelled, band = (f"{words.number(round(watts, 1))} W" for watts in (abs(extra), nominal, BAND_SD * sd))
    amount = f"{size} {'more' if extra > 0 else 'less'}"
    beside = f"than the modelled {modelled}, ± {band} at any time"
    if cause is not None:
        return f"Not the {node}: the filter puts {amount} there {beside}, yet the evidence names {cause}"
    if abs(extra) < PLAIN * sd:
        return f"The filter sees no other loss at the {node}: {amount} {beside}"
    return f"The filter puts {amount} loss at the {node} {beside}"


def filter_over_time(run: Run, columns: int) -> Plot | None:
    """Measured, open loop, filter and smoother at the channel that is told first, what each leaves of it, and the
    estimated heat with its band; None without a filter or such a channel. `columns` to thin to."""
    filtered, worst = run.filtered, worst_compared(run.summary)
    channel = next((o for o in run.observed if o.channel == worst and o.node in run.nodes), None)
    if filtered is None or channel is None:
        return None
    title, time = words.capital(compared(run.summary)[0]), time_axis(run)
    with style(f"{run.session} filter over time"):
        figure, (upper, middle, lower, *below) = panels(WIDTH, (1.2, 0.6, 0.8, *strip(run)), top=0.08)
        _draw_channel(upper, channel, courses(run, filtered, channel), time, columns)
        _draw_left(middle, channel, courses(run, filtered, channel), time, columns)
        _draw_heat(lower, filtered, time, run.t_ns[1:], columns)
        over_driving(lower, below, run, columns)
        svg = inline_svg(figure, title)
    note = f"{words.capital(loss(run.summary) or _finding(filtered, None))}."
    return Plot(title, svg, note, _channel_table(run, channel, filtered, time))


Courses = list[tuple[str, Floats, str, Any]]  # name, what the channel would have shown (M,), colour, line style


def courses(run: Run, filtered: Filtered, channel: Observed) -> Courses:
    """What a channel would have shown (M,) [degC] by open loop, filter and smoother, all with the open loop's lag."""
    i, t = run.nodes.index(channel.node), run.t_ns

    def as_seen(temperatures: Floats) -> Floats:
        return channel.modelled + np.interp(channel.t_ns, t, temperatures[:, i] - run.temperatures[:, i])

    lines: Courses = [("open loop", channel.modelled, COLOURS[1], DASHES[0])]
    lines.append(("filter", as_seen(filtered.temperatures), COLOURS[0], DASHES[2]))
    if filtered.smoothed:
        lines.append(("smoother", as_seen(filtered.smoothed.temperatures), COLOURS[3], "-"))
    return lines


Ends = list[tuple[float, str, str]]  # of lines: value, name, colour


def _draw_lines(
    axes: Axes, time: TimeAxis, t_ns: NDArray[np.int64], lines: Iterable[Any], columns: int, what: str
) -> Ends:
    """`lines` as `Courses`; `what` they are, with a place for the name and the unit: "{} loss [W]"."""
    ends = []
    for name, values, colour, dashes in lines:
        own = {"color": colour, "linestyle": dashes, "linewidth": 1.2, "gid": named(what.format(name))}
        draw(axes, time, t_ns, values, columns, **own)
        ends.append((float(values[-1]), name, colour))
    return ends


def _draw_channel(axes: Axes, channel: Observed, lines: Courses, time: TimeAxis, columns: int) -> None:
    node = words.name(channel.node)
    own: Any = {"color": INK[0], "linewidth": 1.6, "gid": named(f"{node} measured [°C]")}
    draw(axes, time, channel.t_ns, channel.measured, columns, channel.used, **own)
    ends = _draw_lines(axes, time, channel.t_ns, lines, columns, f"{node} {{}} [°C]")
    axes.set_ylabel(f"{node}\n[°C]")
    name_lines(axes, [(float(channel.measured[-1]), "measured", INK[0]), *ends])


def _draw_left(axes: Axes, channel: Observed, lines: Courses, time: TimeAxis, columns: int) -> None:
    """What each estimate leaves of the measured temperature [K]."""
    around_zero(axes, channel.floor_K)
    for name, values, colour, dashes in lines:
        line: Any = {"color": colour, "linestyle": dashes, "linewidth": 1.1, "gid": named(f"residual {name} [K]")}
        draw(axes, time, channel.t_ns, channel.measured - values, columns, channel.used, **line)
    axes.set_ylabel("measured −\neach [K]", fontsize=SMALL)


def _channel_table(run: Run, channel: Observed, filtered: Filtered, time: TimeAxis) -> FigureTable:
    i = instants(channel.t_ns.size)
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
    cells = [[f"{t:.2f}" for t in time.of(channel.t_ns[i])], *([words.fixed(v) for v in values] for values in numbers)]
    return FigureTable(head, tuple(zip(*cells, strict=True)))


def _draw_heat(axes: Axes, filtered: Filtered, time: TimeAxis, t_ns: NDArray[np.int64], columns: int) -> None:
    """Smoothed solid, estimated dash-dotted, modelled dashed; grey: two standard deviations of the best of them."""
    best, i = filtered.smoothed or filtered, instants(t_ns.size, columns)
    band = BAND_SD * best.heat_sd_W
    axes.fill_between(time.of(t_ns[i]), (best.heat_W - band)[i], (best.heat_W + band)[i], gid=MOVING, **BAND)
    lines = [
        ("estimated", filtered.heat_W, COLOURS[0], DASHES[2]),
        ("modelled", filtered.nominal_W, COLOURS[1], DASHES[0]),
    ]
    if filtered.smoothed:
        lines.append(("smoothed", filtered.smoothed.heat_W, COLOURS[3], "-"))
    ends = _draw_lines(axes, time, t_ns, lines, columns, "{} loss [W]")
    axes.axhline(0, color=SOFT[0], linewidth=0.8)
    axes.set_ylabel(f"loss of the\n{words.name(filtered.node)} [W]")
    name_lines(axes, ends)


def _draw_temperatures(axes: Axes, run: Run, filtered: Filtered, time: TimeAxis, columns: int) -> None:
    """Measured, open loop and filter at the node of the heat; a channel that the filter did not read is called kept."""
    i, ends = run.nodes.index(filtered.node), []
    for o in (o for o in run.observed if o.node == filtered.node):
        own: Any = {"color": COLOURS[2], "linewidth": 1.4, "gid": named(f"{o.channel} measured [°C]")}
        draw(axes, time, o.t_ns, o.measured, columns, o.used, **own)
        name = o.channel if o.channel in filtered.measured else f"{o.channel}, kept"
        ends.append((float(o.measured[-1]), name, COLOURS[2]))
    lines = [
        ("filtered", filtered.temperatures[:, i], COLOURS[0], DASHES[2]),
        ("open loop", run.temperatures[:, i], COLOURS[1], DASHES[0]),
    ]
    if filtered.smoothed:
        lines.append(("smoothed", filtered.smoothed.temperatures[:, i], COLOURS[3], "-"))
    ends += _draw_lines(axes, time, run.t_ns, lines, columns, f"{words.name(filtered.node)} {{}} [°C]")
    axes.set_ylabel("temperature\nthere [°C]")
    name_lines(axes, ends)


def _table(run: Run, filtered: Filtered, time: TimeAxis) -> FigureTable:
    i, node, smooth = instants(filtered.heat_W.size), run.nodes.index(filtered.node), filtered.smoothed
    columns = {
        "estimated [W]": filtered.heat_W[i],
        "standard deviation [W]": filtered.heat_sd_W[i],
        "modelled [W]": filtered.nominal_W[i],
        "filtered [°C]": filtered.temperatures[i + 1, node],
        "open loop [°C]": run.temperatures[i + 1, node],
    }
    if smooth:
        columns |= {"smoothed [W]": smooth.heat_W[i], "standard deviation smoothed [W]": smooth.heat_sd_W[i]}
        columns["smoothed [°C]"] = smooth.temperatures[i + 1, node]
    cells = [[f"{t:.2f}" for t in time.of(run.t_ns[i + 1])], *([words.fixed(v) for v in c] for c in columns.values())]
    return FigureTable((time.label, *columns), tuple(zip(*cells, strict=True)))
