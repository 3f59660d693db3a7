"""The insulation of a stator across its ageing cycles, in SQL.

marimo edit notebooks/insulation.py -- --store DIR
python notebooks/insulation.py --store DIR        prints the answer alone
"""
# ruff: noqa: PLR1711 (marimo writes `return` at the end of every cell)

import marimo

__generated_with = "0.25.2"
app = marimo.App(
    width="medium",
    app_title="Insulation across ageing cycles",
    sql_output="native",
)


@app.cell
def _():
    import os
    import sys

    import marimo as mo
    from matplotlib.figure import Figure
    from scipy.stats import t as student

    from analytics import warehouse
    from analytics.errors import AnalyticsError
    from ingest.errors import IngestError
    from replay.show.palette import COLOURS, DASHES

    return (
        AnalyticsError,
        COLOURS,
        DASHES,
        Figure,
        IngestError,
        mo,
        os,
        student,
        sys,
        warehouse,
    )


@app.cell
def _(mo):
    mo.md(r"""
    # Does the insulation get worse?

    An ageing campaign puts a stator into an oven, again and again, and after each cycle sends direct current through it until
    its temperatures are steady. Insulation that conducts heat worse shows as a higher thermal resistance from copper to iron,

    $$R = \frac{T_{copper} - T_{iron}}{V I}$$

    and not as a hotter winding alone: that also follows the room, the coolant and a surface that darkens. Below, R is set against
    the dose: the hours that the hottest copper channel has spent above 180 °C, the limit of class H.
    """)
    return


@app.cell
def _(AnalyticsError, IngestError, mo, os, sys, warehouse):
    folder = str(mo.cli_args().get("store") or os.environ.get("WHYHOT_STORE") or "whyhot-store")
    try:
        store, no_store = warehouse.connect(folder), ""
    except (IngestError, AnalyticsError) as error:
        store, no_store = None, str(error)
        if mo.app_meta().mode == "script":
            print(no_store, file=sys.stderr)
            sys.exit(2)
    mo.stop(store is None, mo.callout(no_store, kind="danger"))
    return (store,)


@app.cell
def _(mo, store):
    oven_rows = mo.sql(
        """
        SELECT
            specimen, name, start, hours_above_180degC, equivalent_1eV_h, equivalent_10K_h, highest_degC, mean_above_degC,
            hottest_channel, unknown_h, why_no_hours
        FROM cycles
        ORDER BY specimen, start
        """,
        output=False,
        engine=store,
    )
    return (oven_rows,)


@app.cell
def _(mo, oven_rows):
    cycles = oven_rows.to_arrow_table()
    mo.vstack(
        [
            mo.md("""
            ## In the oven

            An hour counts whole above 180 °C and not at all below. An hour at 230 °C uses up far more of the insulation's life than
            one at 181 °C, so doses compare only between cycles at the same temperature: look at `mean_above_degC`, or at the same
            hours as hours at 180 °C, once by Arrhenius with 1.0 eV and once by the 10 K rule: two rules, never to be added.
            """),
            mo.ui.table(cycles, selection=None),
        ]
    )
    return


@app.cell
def _(mo, store):
    check_rows = mo.sql(
        """
        SELECT
            specimen, name, start, dose_h, resistance_K_per_W, copper_degC, iron_degC, power_W, drift_percent,
            why_no_resistance, why_no_dose, copper_from, iron_from, concat(copper_from, ' - ', iron_from) AS channels
        FROM dc_checks
        ORDER BY specimen, start
        """,
        output=False,
        engine=store,
    )
    return (check_rows,)


@app.cell
def _(check_rows, mo):
    check_table = check_rows.to_arrow_table()
    checks = check_table.to_pylist()
    mo.vstack(
        [
            mo.md("""
            ## After each cycle

            R is null where the check cannot tell it, and `why_no_resistance` says why; it is never filled in. Steady means: 20 min of
            load without a break, and R over the last 10 min within 1 % of that over the 10 min before.
            """),
            mo.ui.table(check_table, selection=None),
        ]
    )
    return (checks,)


@app.cell
def _(mo, store):
    trend_rows = mo.sql(
        """
        WITH usable AS (  -- `channels`: a check with others has a level of its own
            SELECT specimen, concat(copper_from, ' - ', iron_from) AS channels, dose_h, ln(resistance_K_per_W) AS y
            FROM dc_checks
            WHERE resistance_K_per_W IS NOT NULL AND dose_h IS NOT NULL
        ),
        repeats AS (  -- checks of a specimen within the same hour of dose
            SELECT channels, count(*) - 1 AS freedom, var_pop(y) * count(*) AS squares
            FROM usable
            GROUP BY specimen, channels, round(dose_h)
        ),
        spread AS (  -- one rig repeats alike with every specimen
            SELECT channels, sum(freedom)::INTEGER AS freedom, sqrt(sum(squares) / nullif(sum(freedom), 0)) AS sd
            FROM repeats
            GROUP BY channels
        ),
        lines AS (
            SELECT
                specimen,
                channels,
                count(*) AS checks,
                max(dose_h) AS highest_dose_h,
                regr_slope(y, dose_h) AS slope,
                regr_intercept(y, dose_h) AS intercept,
                regr_sxx(y, dose_h) AS sxx,
                sqrt(greatest(regr_syy(y, dose_h) - regr_slope(y, dose_h) * regr_sxy(y, dose_h), 0) / nullif(count(*) - 2, 0)) AS off
            FROM usable
            GROUP BY specimen, channels
        )
        SELECT
            specimen,
            channels,
            checks,
            highest_dose_h,
            1e4 * slope AS slope_percent_per_100h,
            1e4 * sd / sqrt(nullif(sxx, 0)) AS standard_error,
            freedom,
            100 * sd AS repeatability_percent,
            100 * off AS off_the_line_percent,
            intercept
        FROM lines
        JOIN spread USING (channels)
        ORDER BY highest_dose_h DESC, specimen, channels
        """,
        output=False,
        engine=store,
    )
    return (trend_rows,)


@app.cell
def _(mo, student, trend_rows):
    def judged(row):
        """The row of a specimen with `low` and `high` of its slope, 99 %, and what they mean in words."""
        slope, error, freedom = row["slope_percent_per_100h"], row["standard_error"], row["freedom"]
        if slope is None:
            return {**row, "low": None, "high": None, "says": "only one dose so far: no trend can be told"}
        if error is None:
            return {**row, "low": None, "high": None, "says": "no check was repeated at its dose: no trend can be told"}
        half = float(student.ppf(0.995, freedom)) * error
        low, high = slope - half, slope + half
        range_ = f"{slope:+.1f} % per 100 h ({low:+.1f} to {high:+.1f})"
        if low > 0:
            says = f"R rises, {range_}: heat leaves the winding worse"
        elif high < 0:
            says = f"R falls, {range_}: heat leaves the winding better, as after a post-cure"
        else:
            says = f"no change beyond repeatability, {range_}"
        return {
            **row,
            "low": low,
            "high": high,
            "says": f"{says}; checks repeat within {row['repeatability_percent']:.1f} %",
        }

    trends = [judged(row) for row in trend_rows.to_arrow_table().to_pylist()]
    answer = [f"{row['specimen']}: {row['says']}" for row in trends] or [
        "No check with both resistance and dose: see why_no_resistance and why_no_dose in dc_checks."
    ]
    if mo.app_meta().mode == "script":
        print("\n".join(answer))
    mo.vstack(
        [
            mo.md("## Answer\n\n" + "\n".join(f"- {line}" for line in answer)),
            mo.ui.table([{k: v for k, v in row.items() if k != "intercept"} for row in trends], selection=None),
            mo.md("""
            The slope is that of ln R, so it is a share. Its range, 99 %, is Student's for the repeatability: the scatter (one standard
            deviation) of checks that were repeated at the same dose, over all specimens with the same channels, never the distance
            from the line. One healthy specimen in a hundred falls outside such a range by chance. Where `off_the_line_percent` is
            well above `repeatability_percent`, a straight line is the wrong form: insulation often cures first, and R dips before
            it rises. A check with other channels than the rest starts a row of its own.
            """),
        ]
    )
    return (trends,)


@app.cell
def _(COLOURS, DASHES, Figure, checks, mo, trends):
    from math import exp

    shown = trends[: len(COLOURS)]  # those with the highest dose
    figure = Figure(figsize=(8.0, 4.5), layout="constrained")
    axes = figure.subplots()
    for trend, colour, dashes in zip(shown, COLOURS, DASHES, strict=False):
        mine = [
            row
            for row in checks
            if row["specimen"] == trend["specimen"]
            and row["channels"] == trend["channels"]
            and None not in (row["resistance_K_per_W"], row["dose_h"])
        ]
        values = [row["resistance_K_per_W"] for row in mine]
        spread = [value * (trend["repeatability_percent"] or 0.0) / 100 for value in values]
        axes.errorbar(
            [row["dose_h"] for row in mine], values, spread, fmt="o", color=colour, capsize=3, label=trend["specimen"]
        )
        if trend["slope_percent_per_100h"] is not None:
            ends = [0.0, trend["highest_dose_h"]]
            line = [exp(trend["intercept"] + trend["slope_percent_per_100h"] / 1e4 * dose) for dose in ends]
            axes.plot(ends, line, color=colour, linestyle=dashes)
    worse = sum(row["low"] is not None and row["low"] > 0 for row in trends)
    axes.set_title(
        f"R rises in {worse} of {len(trends)} specimens" + (f", {len(shown)} drawn" if len(shown) < len(trends) else "")
    )
    axes.set_xlabel("hours above 180 °C")
    axes.set_ylabel("R copper to iron [K/W]")
    if shown:
        axes.legend(title="bar: one standard deviation of repeats")
    mo.vstack([mo.md("## R against dose"), figure])
    return


@app.cell
def _(mo):
    mo.md(r"""
    ## What these numbers cannot tell

    - **Where.** R sums up enamel, resin, liner, the way along the copper to its sensors and the iron around its own. A sensor that moved
      or came off changes it too: `copper_from` and `iron_from` name the channels, which must be the same in every check.
    - **How much of the insulation.** Heat that leaves the end windings otherwise does not pass the slot liner, so R changes by less than
      the conductance from winding to teeth does.
    - **Strength.** R is thermal. Whether the insulation still holds voltage is what the electrical check says; resin may darken, crack
      or lose strength while R stays.
    - **Life.** Class H is meant to last 20,000 h at 180 °C. At 230 °C that is 625 h by the 10 K rule, 1,217 h for 1.1 eV and 2,025 h
      for 0.9 eV: 300 h at 230 °C are 48, 25 or 15 % of it. The dose here knows no such law.
    - **Cause.** A steady rise with dose is what ageing looks like; a clamp that relaxes with the cycles looks the same.
    """)
    return


if __name__ == "__main__":
    app.run()
