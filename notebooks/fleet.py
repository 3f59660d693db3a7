"""The health of a fleet's insulation: slopes with bands, who is not as the others, and what life is left, in SQL.

whyhot notebook fleet --store DIR
python notebooks/fleet.py --store DIR        prints the answer alone
"""
# ruff: noqa: PLR1711 (marimo writes `return` at the end of every cell)

import marimo

__generated_with = "0.25.2"
app = marimo.App(width="medium", app_title="Fleet health")


@app.cell
def _():
    import altair as alt
    import marimo as mo
    import pyarrow.compute as pc

    from replay.show.notebooks import cells
    from replay.show.words import words
    from replay.show.words.palette import COLOURS, INK, SOFT

    return COLOURS, INK, SOFT, alt, cells, mo, pc, words


@app.cell
def _(mo):
    mo.md(r"""
    # Which motors age faster than the others?

    A check says how well heat still leaves a winding; a fleet of checks says how motors differ. Below, each motor's own slope of R over
    the dose with its band, the batches, and what stands out: batches first, then motors within them, at a stated rate of false discoveries.
    """)
    return


@app.cell
def _(cells):
    folder, store = cells.connected()
    return folder, store


@app.cell
def _(store):
    motor_rows = store.sql(
        """
        SELECT
            f.specimen,
            coalesce(f.batch, 'no batch') AS batch,
            f.checks,
            f.dose_h,
            f.slope_percent_per_100h,
            f.slope_low,
            f.slope_high,
            f.fleet_slope_percent_per_100h,
            f.fleet_slope_percent_per_100h - 2 * f.fleet_slope_sd AS fleet_low,
            f.fleet_slope_percent_per_100h + 2 * f.fleet_slope_sd AS fleet_high,
            f.score,
            f.outlying,
            coalesce(b.outlying, false) AS batch_outlying,
            if(f.outlying, 'motor', if(batch_outlying, 'batch', 'neither')) AS stands_out,
            f.significant,
            CASE f.form
                WHEN 'none' THEN 'no change'
                WHEN 'monotone' THEN if(f.slope_percent_per_100h < 0, 'falls', 'rises')
                WHEN 'dip_then_rise' THEN 'falls, rises'
                ELSE 'changes'
            END AS course,
            100 * l.life_used_low AS life_used_low,
            100 * l.life_used_high AS life_used_high,
            f.remaining_low_h,
            f.remaining_high_h,
            f.why
        FROM fleet_health AS f
        LEFT JOIN batches AS b ON b.batch = f.batch
        LEFT JOIN life_used AS l ON l.specimen = f.specimen
        ORDER BY f.outlying DESC, batch_outlying DESC, f.score DESC NULLS LAST, f.specimen
        """
    )
    return (motor_rows,)


@app.cell
def _(store):
    batch_rows = store.sql(
        """
        SELECT batch, specimens, slope_percent_per_100h, score, outlying
        FROM batches
        ORDER BY score DESC NULLS LAST, batch
        """
    )
    return (batch_rows,)


@app.cell
def _(batch_rows, cells, folder, motor_rows, words):
    motors, batches = motor_rows.to_arrow_table(), batch_rows.to_arrow_table()
    rows = motors.to_pylist()

    def sloped(row):
        return f"{row['slope_percent_per_100h']:+.1f} % per 100 h, {row['score']:+.1f} sd".replace("-", "−")

    bad_batches = [row for row in batches.to_pylist() if row["outlying"]]
    bad_motors = [row for row in rows if row["outlying"]]
    weighed = [row["significant"] for row in rows if row["significant"] is not None]
    of_those = "" if len(weighed) == len(rows) else f" of {len(weighed):,} whose courses were weighed"
    answer = [
        words.counted(len(rows), "specimen")
        + (f" in {batches.num_rows} batches, " if batches.num_rows > 1 else ", ")
        + f"{words.counted(sum(row['checks'] for row in rows), 'check')}; "
        + f"{sum(weighed):,}{of_those} change beyond repeatability",
        *(
            f"batch {row['batch']} is not as the others: {sloped(row)}, {row['specimens']} specimens"
            for row in bad_batches
        ),
        *(f"{row['specimen']} ({row['batch']}) is not as the others: {sloped(row)}" for row in bad_motors),
    ]
    if not bad_batches and not bad_motors:
        answer.append("none stands out from the others")
    soonest = sorted(
        (row for row in rows if row["remaining_low_h"] is not None), key=lambda row: row["remaining_low_h"]
    )[:3]
    answer += [
        f"{row['specimen']}: past its end of life"
        if row["remaining_high_h"] == 0
        else f"{row['specimen']}: at least {row['remaining_low_h']:,.0f} h of dose left (90 %)"
        if row["remaining_high_h"] is None
        else f"{row['specimen']}: {row['remaining_low_h']:,.0f} to {row['remaining_high_h']:,.0f} h of dose left (90 %)"
        for row in soonest
    ]
    if not rows:
        answer = [f"No assessment of insulation in this store yet: whyhot ageing --store {folder} makes one."]
    cells.answered(answer)
    return batches, motors


@app.cell
def _(store):
    check_rows = store.sql(
        """
        SELECT c.specimen, coalesce(c.batch, 'no batch') AS batch, c.dose_h, 1e4 / c.conductivity_percent AS percent
        FROM conductivity_by_cycle AS c
        WHERE c.dose_h IS NOT NULL AND c.conductivity_percent IS NOT NULL
        ORDER BY c.specimen, c.dose_h
        """
    )
    return (check_rows,)


@app.cell
def _(COLOURS, INK, SOFT, alt, cells, check_rows, motors, pc):
    shown = motors.slice(0, 40)
    checks = check_rows.to_arrow_table()
    checks = checks.filter(pc.is_in(checks["specimen"], value_set=shown["specimen"]))
    clicked = alt.selection_point(fields=["specimen"], on="click", nearest=True, empty=False)
    kinds = ["motor", "batch", "neither"]
    standing = alt.Color(
        "stands_out:N", title="stands out", scale=alt.Scale(domain=kinds, range=[COLOURS[1], COLOURS[4], COLOURS[0]])
    )
    order = shown["specimen"].to_pylist()
    of_motor = alt.Y("specimen:N", title=None, sort=order)
    tips = [
        "specimen",
        "batch",
        "checks",
        "dose_h",
        "slope_percent_per_100h",
        "slope_low",
        "slope_high",
        "score",
        "course",
    ]
    drawn = alt.Chart(shown)
    none = alt.Chart(alt.Data(values=[{"zero": 0.0}])).mark_rule(color=INK[0], strokeWidth=0.7).encode(x="zero:Q")
    slopes = alt.layer(
        none,
        drawn.mark_rule().encode(alt.X("slope_low:Q"), of_motor, alt.X2("slope_high:Q"), standing),
        drawn.mark_point(filled=True, opacity=1.0).encode(
            alt.X("slope_percent_per_100h:Q", title="change of R, % per 100 h of dose (bar: 95 %)"),
            of_motor,
            standing,
            alt.Shape("stands_out:N", title="stands out", scale=alt.Scale(domain=kinds, range=["diamond", "square", "circle"])),
            size=alt.condition(clicked, alt.value(160), alt.value(45)),
            tooltip=tips,
        ).add_params(clicked),
        title=f"{len(order)} of {motors.num_rows}, those that stand out first; click one",
    ).properties(width=0.45 * cells.WIDE, height={"step": 12})  # fmt: skip
    lines = alt.Chart(checks).encode(
        alt.X("dose_h:Q", title="hours above 180 °C"),
        alt.Y("percent:Q", title="R, % of the first", scale=alt.Scale(zero=False)),
        detail="specimen:N",
    )
    courses = alt.layer(
        lines.mark_line(color=SOFT[0], opacity=0.25, strokeWidth=0.8),
        lines.mark_line(color=COLOURS[1], point=alt.OverlayMarkDef(color=COLOURS[1])).transform_filter(clicked),
        title="R over the dose, the clicked one in colour",
    ).properties(width=0.45 * cells.WIDE, height=320)  # fmt: skip
    chart = slopes | courses
    cells.drawn(chart) if motors.num_rows else None
    return (chart,)


@app.cell
def _(COLOURS, INK, alt, batches, cells):
    per_batch = (
        alt.Chart(batches, title="Batches: mean change of R, % per 100 h of dose")
        .mark_bar()
        .encode(
            alt.X("slope_percent_per_100h:Q", title="% per 100 h"),
            alt.Y("batch:N", title=None, sort=batches["batch"].to_pylist()),
            alt.Color(
                "outlying:N",
                title="stands out",
                scale=alt.Scale(domain=[True, False], range=[COLOURS[1], COLOURS[0]]),
                legend=alt.Legend(labelExpr="datum.value ? 'yes' : 'no'"),
            ),
            stroke=alt.condition("datum.outlying", alt.value(INK[0]), alt.value(None)),
            tooltip=["batch", "specimens", "slope_percent_per_100h", "score", "outlying"],
        )
        .properties(width=cells.WIDE)
    )
    cells.drawn(per_batch) if batches.num_rows > 1 else None
    return (per_batch,)


@app.cell
def _(COLOURS, SOFT, alt, cells, mo, motors):
    left = motors.filter(motors["remaining_low_h"].is_valid()).sort_by("remaining_low_h").slice(0, 40)
    remaining = (
        alt.Chart(left, title="Dose that is left until the criterion, the shortest first, 90 %; an arrow has no upper end")
        .transform_calculate(open="!isValid(datum.remaining_high_h)", end="datum.open ? datum.remaining_low_h : datum.remaining_high_h")
        .encode(alt.Y("specimen:N", title=None, sort=alt.SortField("remaining_low_h")))
    )  # fmt: skip
    bars = remaining.mark_rule(color=COLOURS[0], strokeWidth=3).encode(
        alt.X("remaining_low_h:Q", title="h above 180 °C"), alt.X2("end:Q")
    )
    arrows = (
        remaining.mark_point(shape="triangle-right", filled=True, color=SOFT[0], size=60)
        .encode(alt.X("end:Q"))
        .transform_filter("datum.open")
    )
    how_long = (bars + arrows).properties(width=cells.WIDE, height={"step": 12})
    cells.drawn(how_long) if left.num_rows else mo.md(
        "What life is left is not told: no specimen's course reaches the criterion within what its checks allow."
        if motors.num_rows
        else ""
    )
    return (how_long,)


@app.cell
def _(cells, mo, motors):
    mo.vstack([mo.md("## Every motor"), cells.tabled(motors)]) if motors.num_rows else None
    return


@app.cell
def _(mo):
    mo.md(r"""
    ## What these numbers cannot tell

    - A motor with two or three checks has a slope of its own that is mostly chance: its band says so, and the slope with
      the fleet's is what it and the fleet say together.
    - That nothing stands out does not mean that nothing is wrong: all may age alike.
    - A motor that stands out is not ill by that; look at its checks, and whether its sensor was exchanged, first.
    """)
    return


if __name__ == "__main__":
    app.run()
