"""The insulation of one stator across its oven cycles, as the latest `whyhot ageing` has it, in SQL.

whyhot notebook insulation --store DIR
python notebooks/insulation.py --store DIR        prints the answer alone
"""
# ruff: noqa: PLR1711 (marimo writes `return` at the end of every cell)

import marimo

__generated_with = "0.25.2"
app = marimo.App(width="medium", app_title="Insulation of one stator")


@app.cell
def _():
    import altair as alt
    import marimo as mo

    from replay.show.notebooks import cells
    from replay.show.words import words
    from replay.show.words.palette import COLOURS, INK, SOFT

    return COLOURS, INK, SOFT, alt, cells, mo, words


@app.cell
def _(mo):
    mo.md(r"""
    # Does the insulation get worse?

    An ageing campaign puts a stator into an oven, again and again, and after each cycle sends direct current through it. Insulation that
    conducts heat worse shows as a higher thermal resistance R from copper to iron, and not as a hotter winding alone: that also follows
    the room and a surface that darkens. `whyhot ageing` takes R from every check, sets it against the dose (hours above 180 °C, the limit
    of class H) and asks which form its course has, and whether checks that repeat as these do would show as much without any change.
    """)
    return


@app.cell
def _(cells):
    folder, store = cells.connected()
    return folder, store


@app.cell
def _(store):
    course_rows = store.sql(
        """
        SELECT
            f.specimen, f.batch, f.checks, f.form, f.form_probability, f.significant, p.change_at_dose_h,
            f.slope_percent_per_100h, f.slope_low, f.slope_high, f.repeatability_percent, f.why,
            f.fleet_slope_percent_per_100h,
            f.dose_h, l.equivalent_low_h, l.equivalent_high_h, l.life_used_low, l.life_used_high, c.conductivity_percent
        FROM fleet_health AS f
        LEFT JOIN changepoints AS p ON p.specimen = f.specimen
        LEFT JOIN life_used AS l ON l.specimen = f.specimen
        LEFT JOIN (
            SELECT specimen, arg_max(conductivity_percent, number) AS conductivity_percent
            FROM conductivity_by_cycle
            GROUP BY specimen
        ) AS c ON c.specimen = f.specimen
        ORDER BY f.specimen
        """
    )
    return (course_rows,)


@app.cell
def _(cells, course_rows, folder, words):
    courses = course_rows.to_arrow_table().to_pylist()
    forms = {
        "dip_then_rise": "R falls, then rises",
        "changepoint": "R changes course",
    }

    def said(row):
        """The course of a specimen in words, with its numbers."""
        if row["slope_percent_per_100h"] is None:
            return f"nothing can be told: {row['why'] or 'no check with both R and dose'}"
        slope, low, high = (words.signed(row[name]) for name in ("slope_percent_per_100h", "slope_low", "slope_high"))
        slope = f"{slope} % per 100 h ({low} to {high})"
        if not row["significant"] and row["fleet_slope_percent_per_100h"] is not None:
            slope = f"{words.signed(row['fleet_slope_percent_per_100h'])} % per 100 h by its checks and the fleet"
        if not row["significant"]:
            return f"no change beyond repeatability ({row['repeatability_percent']:.1f} %), {slope}"
        monotone = "R rises steadily" if row["slope_percent_per_100h"] > 0 else "R falls steadily"
        at = "" if row["change_at_dose_h"] is None else f"{row['change_at_dose_h']:.0f} h"
        turn = at and (f" from {at} on" if row["form"] == "dip_then_rise" else f" at {at}")
        sure = f"this form at {100 * row['form_probability']:.0f} %"
        return f"{forms.get(row['form'], monotone)}{turn}, {slope}; {sure}; conducts {row['conductivity_percent']:.0f} % of its start"

    answer = [f"{row['specimen']}: {said(row)}" for row in courses] or [
        f"No assessment of insulation in this store yet: whyhot ageing --store {folder} makes one."
    ]
    cells.answered(answer)
    return (courses,)


@app.cell
def _(cells, courses):
    names = [row["specimen"] for row in courses]
    first = next((row["specimen"] for row in courses if row["significant"]), names[0] if names else None)
    picked = cells.choice(names, first)
    cells.offered({"Stator": picked}) if names else None
    return (picked,)


@app.cell
def _(picked, store):
    check_rows = store.sql(
        f"""
        SELECT
            c.number,
            c.session_name,
            c.start,
            c.dose_h,
            c.equivalent_low_h,
            c.equivalent_high_h,
            1e4 / c.conductivity_percent AS percent,
            2 * percent * c.sd_percent / 100 AS reach,
            percent - reach AS low,
            percent + reach AS high,
            c.resistance_K_per_W,
            c.sd_K_per_W,
            c.source,
            c.state,
            c.why,
            c.hottest_channel,
            c.hottest_degC
        FROM conductivity_by_cycle AS c
        WHERE c.specimen = '{str(picked.value).replace("'", "''")}'
        ORDER BY c.number
        """
    )
    return (check_rows,)


@app.cell
def _(COLOURS, INK, SOFT, alt, cells, check_rows, courses, picked):
    checks = check_rows.to_arrow_table()
    course = next((row for row in courses if row["specimen"] == picked.value), None)
    of_dose = alt.X("dose_h:Q", title="hours above 180 °C")
    tips = ["session_name", "dose_h", "resistance_K_per_W", "sd_K_per_W", "source", "hottest_channel", "hottest_degC"]
    drawn = alt.Chart(checks)
    of_start = alt.Y("percent:Q", title="R, % of the first", scale=alt.Scale(zero=False))
    layers = [
        alt.Chart(alt.Data(values=[{"percent": 100.0}])).mark_rule(color=INK[0], strokeWidth=0.7).encode(y="percent:Q"),
        drawn.mark_rule(color=COLOURS[0]).encode(of_dose, alt.Y("low:Q"), alt.Y2("high:Q")),
        drawn.mark_line(color=COLOURS[0], point=alt.OverlayMarkDef(color=COLOURS[0], size=40)).encode(
            of_dose, of_start, tooltip=tips
        ),
    ]
    if course and course["significant"] and course["change_at_dose_h"] is not None:
        turn = alt.Chart(alt.Data(values=[{"dose_h": course["change_at_dose_h"]}]))
        layers.append(turn.mark_rule(color=COLOURS[1], strokeDash=[5, 3]).encode(x="dose_h:Q"))
    title = f"{picked.value}: R over the dose; bars: two standard deviations, repeatability included"
    resistance = alt.layer(*layers, title=title).properties(width=cells.WIDE, height=280)
    hottest = (
        alt.Chart(checks, title="Its hottest sensor, which follows the room and a darker surface too")
        .mark_line(color=SOFT[0], strokeDash=[4, 2], point=alt.OverlayMarkDef(color=SOFT[0], size=30))
        .encode(of_dose, alt.Y("hottest_degC:Q", title="°C", scale=alt.Scale(zero=False)), tooltip=tips)
        .properties(width=cells.WIDE, height=140)
    )
    chart = resistance & hottest
    cells.drawn(chart) if checks.num_rows else None
    return chart, checks


@app.cell
def _(cells, checks, mo):
    mo.vstack(
        [
            mo.md("""
            ## Each check

            R is empty where a check cannot tell it, and the table says why; it is never filled in. Its source is what R was taken from, in order
            of trust: an iron sensor; the first minutes of heating and cooling; the air around, with the surface's emissivity left free.
            """),
            cells.tabled(checks),
        ]
    ) if checks.num_rows else None
    return


@app.cell
def _(picked, store):
    oven_rows = store.sql(
        f"""
        SELECT
            number, session_name, soak_start, soak_degC, highest_degC, heating_h, soak_h, cooling_h, hours_above_180degC,
            unknown_h
        FROM oven_cycles
        WHERE specimen = '{str(picked.value).replace("'", "''")}'
        ORDER BY number
        """
    )
    return (oven_rows,)


@app.cell
def _(cells, mo, oven_rows):
    cycles = oven_rows.to_arrow_table()
    activation = mo.ui.slider(0.6, 1.4, 0.05, value=1.0, show_value=True)
    mo.vstack(
        [
            mo.md("""
            ## In the oven

            Each thermal cycle, cut from the temperature itself. An hour at 230 °C uses up far more of the insulation's life than one at
            181 °C: what a dose is worth at 180 °C depends on a rule, and nothing in a campaign at one temperature says which. Move it
            below.
            """),
            cells.tabled(cycles),
            cells.offered({"Activation energy [eV]": activation}),
        ]
    ) if cycles.num_rows else None
    return activation, cycles


@app.cell
def _(activation, picked, store):
    worth_rows = store.sql(
        f"""
        SELECT
            sum(hours_above_180degC) AS dose_h,
            sum(equivalent_hours(soak_degC, hours_above_180degC, 180, {activation.value})) AS by_activation_h,
            sum(equivalent_hours_10K(soak_degC, hours_above_180degC, 180)) AS by_10K_h
        FROM oven_cycles
        WHERE specimen = '{str(picked.value).replace("'", "''")}'
        """
    )
    return (worth_rows,)


@app.cell
def _(activation, mo, worth_rows):
    (worth,) = worth_rows.to_arrow_table().to_pylist()
    mo.md(
        f"""
        {worth["dose_h"]:.0f} h above 180 °C are worth **{worth["by_activation_h"]:,.0f} h at 180 °C** by {activation.value:.2f} eV, and
        **{worth["by_10K_h"]:,.0f} h** by the 10 K rule: two rules, never to be added. Class H is meant to last 20,000 h there.
        """
    ) if worth["dose_h"] else None
    return


@app.cell
def _(picked, store):
    finding_rows = store.sql(
        f"""
        SELECT i.happened, i.finding, i.name, i.session_name
        FROM inspections AS i
        WHERE i.specimen = '{str(picked.value).replace("'", "''")}'
        ORDER BY i.happened
        """
    )
    return (finding_rows,)


@app.cell
def _(cells, finding_rows, mo):
    findings = finding_rows.to_arrow_table()
    mo.vstack([mo.md("## What was seen"), cells.tabled(findings)]) if findings.num_rows else None
    return


@app.cell
def _(mo):
    mo.md(r"""
    ## What these numbers cannot tell

    - **Where.** R sums up enamel, resin, liner, the way along the copper to its sensors and the iron around its own. A sensor that moved
      or came off changes it too.
    - **How much of the insulation.** Heat that leaves the end windings otherwise does not pass the slot liner, so R changes by less than
      the insulation does.
    - **Strength.** R is thermal. Whether the insulation still holds voltage is what the electrical check says; resin may darken, crack
      or lose strength while R stays.
    - **Life.** Nor does a course at one temperature say what happens at another: see the activation energy above.
    - **Cause.** A steady rise with dose is what ageing looks like; a clamp that relaxes with the cycles looks the same.
    - **Others.** One stator says nothing of how much stators differ.
    """)
    return


if __name__ == "__main__":
    app.run()
