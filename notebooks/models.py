"""Models against the measurement: how far off each is, where, and what was hottest, in SQL.

whyhot notebook models --store DIR
python notebooks/models.py --store DIR        prints the answer alone
"""
# ruff: noqa: PLR1711 (marimo writes `return` at the end of every cell)

import marimo

__generated_with = "0.25.2"
app = marimo.App(width="medium", app_title="Models against measurement")


@app.cell
def _():
    import altair as alt
    import marimo as mo

    from replay.show.notebooks import cells
    from replay.show.words import words
    from replay.show.words.palette import COLOURS, DIVERGING, INK

    return COLOURS, DIVERGING, INK, alt, cells, mo, words


@app.cell
def _(mo):
    mo.md(r"""
    # Where is the model wrong?

    A replay runs the thermal network from the measured inputs alone, never from the temperatures that it is judged by. A residual is
    measured minus modelled: above zero the model is too cold. Held, stuck and saturated samples are not counted.
    """)
    return


@app.cell
def _(cells):
    folder, store = cells.connected()
    return folder, store


@app.cell
def _(store):
    run_rows = store.sql(
        """
        WITH latest AS (  -- of the same session with the same model
            FROM runs
            QUALIFY row_number() OVER (PARTITION BY session, model, level ORDER BY recorded DESC) = 1
        ),
        roles AS (  -- as it came, or what was learnt of it
            SELECT
                p.position,
                p.payload->>'model' AS model,
                p.payload->>'motor' AS motor,
                if(p.payload->>'parent' IS NULL, 'as published', if(e.position IS NULL, 'recalibrated', 'extended')) AS role
            FROM events AS p
            LEFT JOIN events AS e ON e.topic = 'whyhot:ModelExtended' AND e.payload->>'model' = p.payload->>'model'
            WHERE p.topic = 'whyhot:ModelPublished'
            QUALIFY row_number() OVER (PARTITION BY motor, model ORDER BY p.position) = 1
        ),
        published AS (
            SELECT model, motor, role, row_number() OVER (PARTITION BY motor, role ORDER BY position) AS number FROM roles
        )
        SELECT
            r.run, r.session_name, r.kind, r.specimen,
            concat_ws(' ', concat(r.motor, ','), p.role, if(p.number > 1, p.number::VARCHAR, NULL), nullif(r.level, 'testing')) AS version,
            r.mae_K, r.max_K, r.worst_node, r.recorded
        FROM latest AS r
        LEFT JOIN published AS p ON p.model = r.model AND p.motor = r.motor
        ORDER BY r.recorded, r.session_name
        """
    )
    return (run_rows,)


@app.cell
def _(store):
    node_rows = store.sql(
        """
        SELECT
            run,
            node,
            avg(residual_K) AS bias_K,
            avg(abs(residual_K)) AS mae_K,
            max(abs(residual_K)) AS max_K,
            max(measured_degC) AS hottest_degC
        FROM residuals
        WHERE used
        GROUP BY run, node
        ORDER BY mae_K DESC
        """
    )
    return (node_rows,)


@app.cell
def _(cells, folder, node_rows, run_rows, words):
    runs, errors = run_rows.to_arrow_table(), node_rows.to_arrow_table()
    of_run = {row["run"]: row for row in runs.to_pylist()}
    by_node = [{**of_run[row["run"]], **row} for row in errors.to_pylist() if row["run"] in of_run]
    versions = list(dict.fromkeys(row["version"] for row in reversed(list(of_run.values()))))  # the latest first

    def summed(version):
        """The mean error of a version over its sessions."""
        mine = [row["mae_K"] for row in of_run.values() if row["version"] == version]
        return sum(mine) / len(mine), len(mine)

    answer = []
    for version in versions:
        mean, count = summed(version)
        answer.append(f"model {version}: {mean:.1f} K mean absolute error over {words.counted(count, 'session')}")
    latest = [row for row in by_node if row["version"] == versions[0]] if versions else []
    if latest:
        worst = max(latest, key=lambda row: row["mae_K"])
        hottest = max(latest, key=lambda row: row["hottest_degC"])
        answer += [
            f"worst of {versions[0]}: {worst['node']} in {worst['session_name']}, {worst['mae_K']:.1f} K on average (bias {words.signed_kelvin(worst['bias_K'])})",
            f"hottest measured: {hottest['node']} {hottest['hottest_degC']:.1f} °C in {hottest['session_name']}",
        ]
    if not versions:
        answer = [
            f"No replay in this store yet: whyhot replay --store {folder} makes one of each session that has a model."
        ]
    cells.answered(answer)
    return by_node, runs, versions


@app.cell
def _(cells, mo, runs, versions):
    picked_version = cells.choice(versions)
    mo.vstack(
        [mo.md("## Replays"), cells.tabled(runs, "run"), cells.offered({"Model": picked_version})]
    ) if versions else None
    return (picked_version,)


@app.cell
def _(COLOURS, INK, alt, by_node, cells, picked_version):
    errors_shown = [
        {key: row[key] for key in ("session_name", "node", "mae_K", "bias_K", "max_K", "hottest_degC")}
        for row in by_node
        if row["version"] == picked_version.value
    ]
    base = alt.Chart(alt.Data(values=errors_shown), title="Mean absolute error, K: node by session").encode(
        alt.X("session_name:N", title=None, sort=None, axis=alt.Axis(labelAngle=-45)), alt.Y("node:N", title=None)
    )
    error_map = (
        base.mark_rect().encode(
            alt.Color(
                "mae_K:Q", title="K", scale=alt.Scale(domainMin=0, range=["#ffffff", COLOURS[1]], interpolate="rgb")
            ),
            tooltip=["session_name:N", "node:N", "mae_K:Q", "bias_K:Q", "max_K:Q", "hottest_degC:Q"],
        )
        + base.mark_text(color=INK[0], fontSize=11).encode(alt.Text("mae_K:Q", format=".1f"))
    ).properties(width=cells.WIDE, height=alt.Step(24))
    cells.drawn(error_map) if errors_shown else None
    return (error_map,)


@app.cell
def _(by_node, cells, picked_version):
    chosen = [row for row in by_node if row["version"] == picked_version.value]
    nodes = list(dict.fromkeys(row["node"] for row in chosen))  # the worst first
    sessions = {row["session_name"]: row["run"] for row in chosen}
    picked_node, picked_session = cells.choice(nodes), cells.choice(sessions)
    cells.offered({"Place": picked_node, "Session": picked_session}) if nodes else None
    return picked_node, picked_session, sessions


@app.cell
def _(picked_node, sessions, store):
    cell_rows = store.sql(
        f"""
        SELECT
            floor(20 * speed_rpm / top_rpm) * top_rpm / 20 AS from_rpm,
            from_rpm + top_rpm / 20 AS to_rpm,
            floor(12 * current_A / top_A) * top_A / 12 AS from_A,
            from_A + top_A / 12 AS to_A,
            avg(residual_K) AS bias_K,
            avg(abs(residual_K)) AS mae_K,
            count(*) AS steps
        FROM residuals
        CROSS JOIN (
            SELECT greatest(1000 * ceil(max(speed_rpm) / 1000), 1) AS top_rpm, greatest(10 * ceil(max(current_A) / 10), 1) AS top_A
            FROM residuals
            WHERE list_contains({list(sessions.values())}::VARCHAR[], run)
        )
        WHERE used AND list_contains({list(sessions.values())}::VARCHAR[], run)
          AND node = '{str(picked_node.value).replace("'", "''")}' AND speed_rpm IS NOT NULL AND current_A IS NOT NULL
        GROUP BY ALL
        """
    )
    return (cell_rows,)


@app.cell
def _(DIVERGING, alt, cell_rows, cells, mo, picked_node):
    operating = cell_rows.to_arrow_table()
    reach = max((abs(value) for value in operating["bias_K"].to_pylist()), default=1.0)
    speed_current = (
        alt.Chart(
            operating, title=f"{picked_node.value}: residual over speed and current, all sessions of this model [K]"
        )
        .mark_rect(stroke="#d0d4da", strokeWidth=0.3)
        .encode(
            alt.X("from_rpm:Q", title="speed [rpm]", axis=alt.Axis(tickCount=8)),
            alt.X2("to_rpm:Q"),
            alt.Y("from_A:Q", title="phase current, rms [A]"),
            alt.Y2("to_A:Q"),
            alt.Color(
                "bias_K:Q",
                title="K",
                scale=alt.Scale(domain=[-reach, 0, reach], range=list(DIVERGING), interpolate="rgb"),
            ),
            tooltip=["from_rpm", "from_A", "bias_K", "mae_K", "steps"],
        )
        .properties(width=cells.WIDE, height=260)
    )
    mo.vstack(
        [
            cells.drawn(speed_current),
            mo.md("Blue: the model is too hot there; orange: too cold."),
        ]
    ) if operating.num_rows else mo.md(
        "Speed and current are not recorded together: no map." if picked_node.value else ""
    )
    return (speed_current,)


@app.cell
def _(picked_node, picked_session, store):
    time_rows = store.sql(
        f"""
        WITH mine AS (
            SELECT * FROM residuals
            WHERE run = '{picked_session.value}' AND node = '{str(picked_node.value).replace("'", "''")}'
        ),
        thinned AS (
            SELECT
                floor(t_s / (SELECT greatest(max(t_s) / 500, 1) FROM mine)) AS part,
                avg(t_s) / 60 AS minute,
                avg(measured_degC) FILTER (WHERE used) AS measured,
                avg(modelled_degC) AS modelled,
                avg(residual_K) FILTER (WHERE used) AS residual_K
            FROM mine
            GROUP BY part
        )
        SELECT minute, measured, modelled, residual_K FROM thinned ORDER BY minute
        """
    )
    return (time_rows,)


@app.cell
def _(COLOURS, INK, alt, cells, picked_node, picked_session, time_rows):
    series = time_rows.to_arrow_table()
    minutes = alt.X("minute:Q", title=None)
    zoom = alt.selection_interval(bind="scales", encodings=["x"])
    both = (
        alt.Chart(series, title=f"{picked_node.value} in {picked_session.selected_key}: measured and modelled; drag and scroll to zoom")
        .transform_fold(["measured", "modelled"], ["what", "degC"])
        .mark_line(strokeWidth=1.3)
        .encode(
            minutes,
            alt.Y("degC:Q", title="°C", scale=alt.Scale(zero=False)),
            alt.Color("what:N", title=None, scale=alt.Scale(domain=["measured", "modelled"], range=[INK[0], COLOURS[1]])),
            alt.StrokeDash("what:N", title=None, scale=alt.Scale(domain=["measured", "modelled"], range=[[1, 0], [5, 2]])),
        )
        .properties(width=cells.WIDE, height=220)
        .add_params(zoom)
    )  # fmt: skip
    off = (
        alt.Chart(series)
        .mark_line(strokeWidth=1.1, color=COLOURS[0])
        .encode(alt.X("minute:Q", title="time since start [min]"), alt.Y("residual_K:Q", title="measured - modelled [K]"))
        .properties(width=cells.WIDE, height=120)
    )  # fmt: skip
    over_time = (both & off).resolve_scale(x="shared")
    cells.drawn(over_time) if series.num_rows else None
    return (over_time,)


@app.cell
def _(picked_session, store):
    hot_rows = store.sql(
        f"""
        SELECT
            t.node,
            max(t.temperature_degC) AS modelled_hottest_degC,
            arg_max(t.t_s, t.temperature_degC) AS modelled_at_s,
            any_value(m.hottest_degC) AS measured_hottest_degC
        FROM temperatures AS t
        LEFT JOIN (
            SELECT node, max(measured_degC) AS hottest_degC
            FROM residuals
            WHERE used AND run = '{picked_session.value}'
            GROUP BY node
        ) AS m ON m.node = t.node
        WHERE t.run = '{picked_session.value}'
        GROUP BY t.node
        ORDER BY modelled_hottest_degC DESC
        """
    )
    return (hot_rows,)


@app.cell
def _(cells, hot_rows, mo):
    hot = hot_rows.to_arrow_table()
    mo.vstack(
        [
            mo.md("## What was hottest, with a sensor and without"),
            cells.tabled(hot),
        ]
    ) if hot.num_rows else None
    return (hot,)


if __name__ == "__main__":
    app.run()
