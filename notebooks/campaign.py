"""A campaign at a glance: what was recorded, how good it is, and what got hot, in SQL.

whyhot notebook campaign --store DIR
python notebooks/campaign.py --store DIR        prints the answer alone
"""
# ruff: noqa: PLR1711 (marimo writes `return` at the end of every cell)

import marimo

__generated_with = "0.25.2"
app = marimo.App(width="medium", app_title="A campaign at a glance")


@app.cell
def _():
    import altair as alt
    import marimo as mo

    from replay.show.notebooks import cells
    from replay.show.words import words
    from replay.show.words.palette import COLOURS, DASHES, INK

    return COLOURS, DASHES, INK, alt, cells, mo, words


@app.cell
def _(mo):
    mo.md(r"""
    # What was recorded, and what got hot

    Every log of a store belongs to one session. Below: the sessions in the order of time, what became of each record, what is wrong
    with the data, and how hot every place became. All of it is SQL over the store's views; change a cell, and what depends on it follows.
    """)
    return


@app.cell
def _(cells):
    _, store = cells.connected()
    return (store,)


@app.cell
def _(store):
    session_rows = store.sql(
        """
        SELECT
            specimen, name, kind, batch, start, round(duration_s / 60, 1) AS minutes, files, channels, quarantined, kind_why,
            session
        FROM sessions
        """
    )
    return (session_rows,)


@app.cell
def _(store):
    record_rows = store.sql(
        """
        SELECT
            count(*) AS files,
            coalesce(sum(found), 0)::BIGINT AS found,
            coalesce(sum(decoded), 0)::BIGINT AS decoded,
            coalesce(sum(unknown_id), 0)::BIGINT AS unknown_id,
            coalesce(sum(wrong_length), 0)::BIGINT AS wrong_length,
            coalesce(sum(rejected), 0)::BIGINT AS rejected,
            count(*) FILTER (WHERE outcome <> 'decoded') AS not_whole
        FROM files
        """
    )
    return (record_rows,)


@app.cell
def _(store):
    flag_rows = store.sql(
        """
        SELECT s.specimen, s.name AS session_name, e.payload->'detail'->>'channel' AS channel, e.payload->>'says' AS what
        FROM events AS e
        LEFT JOIN sessions AS s ON e.stream = concat('session-', s.session)
        LEFT JOIN files AS f ON e.stream = concat('file-', f.file_id)
        WHERE e.topic = 'whyhot:QualityFlagged' AND coalesce(s.session, f.file_id) IS NOT NULL
            AND e.payload->>'flag' <> 'same_name_other_bytes'  -- as the logs of each specimen have
        QUALIFY row_number() OVER (PARTITION BY e.stream, what, channel ORDER BY e.position) = 1
        ORDER BY e.position
        """
    )
    return (flag_rows,)


@app.cell
def _(store):
    heat_rows = store.sql(
        """
        WITH masked AS (  -- what a sensor repeats: the last value that it had, or that of a broken wire
            SELECT stream, payload->'detail'->>'channel' AS channel, unnest((payload->'detail'->'spans')::JSON[]) AS span
            FROM events
            WHERE topic = 'whyhot:QualityFlagged' AND payload->>'flag' IN ('held', 'stuck', 'saturated')
        )
        SELECT
            concat_ws(' ', s.specimen, s.name) AS test,
            s.name AS session_name,
            coalesce(v.node, v.channel) AS place,
            v.region,
            max(v.value) AS highest_degC,
            arg_max(v.t_s, v.value) AS at_s,
            max(v.value) - arg_min(v.value, v.t_s) AS rise_K,
            arg_max(v.channel, v.value) AS channel
        FROM samples AS v
        JOIN sessions AS s ON s.session = v.session
        ANTI JOIN masked AS m ON m.stream = concat('session-', v.session) AND m.channel = v.channel
            AND v.region <> 'boundary' AND v.t_ns BETWEEN (m.span->>'start_ns')::BIGINT AND (m.span->>'end_ns')::BIGINT
        WHERE v.quantity = 'temperature'
        GROUP BY s.specimen, s.name, s.start_ns, v.session, place, v.region
        ORDER BY s.start_ns, s.name, place
        """
    )
    return (heat_rows,)


@app.cell
def _(cells, flag_rows, heat_rows, record_rows, session_rows, words):
    sessions = session_rows.to_arrow_table()
    (records,) = record_rows.to_arrow_table().to_pylist()
    flags = flag_rows.to_arrow_table()
    heats = heat_rows.to_arrow_table()

    kinds = sorted({row["kind"] for row in sessions.to_pylist()})
    parts = (
        f"{records[key]:,} {word}"
        for key, word in (
            ("decoded", "decoded"),
            ("unknown_id", "unknown id"),
            ("wrong_length", "wrong length"),
            ("rejected", "rejected"),
        )
    )
    inside = [row for row in heats.to_pylist() if row["region"] != "boundary"]
    answer = [
        f"{words.counted(sessions.num_rows, 'session')} ({', '.join(kinds)}), {words.counted(records['files'], 'file')}",
        f"{words.counted(records['found'], 'record')} = {' + '.join(parts)}",
        f"{words.counted(flags.num_rows, 'finding')} about the data"
        + (f", {words.counted(records['not_whole'], 'file')} not read whole" if records["not_whole"] else ""),
    ]
    if inside:
        top = max(inside, key=lambda row: row["highest_degC"])
        answer.append(
            f"hottest: {top['place']} {top['highest_degC']:.1f} °C in {top['test']}, after {words.duration(top['at_s'])}"
        )
    if not sessions.num_rows:
        answer = ["No session in this store yet: whyhot ingest FILE... --bench BENCH.toml takes logs in."]
    cells.answered(answer)
    return flags, heats, sessions


@app.cell
def _(cells, flags, mo, sessions):
    mo.vstack(
        [
            mo.md("## Sessions"),
            cells.tabled(sessions, "session"),
            mo.md("## What is wrong with the data"),
            cells.tabled(flags) if flags.num_rows else mo.md("Nothing was found."),
        ]
    )
    return


@app.cell
def _(COLOURS, INK, alt, cells, heats, mo):
    how_hot = alt.Chart(heats, title="How hot each place became [°C], masked samples left out")
    place = alt.Y("place:N", title=None, sort=alt.EncodingSortField("highest_degC", op="max", order="descending"))
    test = alt.X("test:N", title=None, sort=None, axis=alt.Axis(labelAngle=-45))
    map_of_heat = (
        how_hot.mark_rect().encode(
            test,
            place,
            alt.Color("highest_degC:Q", title="°C", scale=alt.Scale(range=["#ffffff", COLOURS[1]], interpolate="rgb")),
            tooltip=["test", "place", "channel", "region", "highest_degC", "rise_K", "at_s"],
        )
        + how_hot.mark_text(color=INK[0], fontSize=10).encode(test, place, alt.Text("highest_degC:Q", format=".0f"))
    ).properties(width=cells.WIDE)
    mo.vstack([mo.md("## What got hot"), cells.drawn(map_of_heat)]) if heats.num_rows else None
    return (map_of_heat,)


@app.cell
def _(cells, mo, sessions):
    names = {
        f"{row['specimen'] or ''} {row['name']} ({row['kind']})".strip(): row["session"] for row in sessions.to_pylist()
    }
    picked = cells.choice(names)
    mo.vstack([mo.md("## One session over time"), cells.offered({"Session": picked})]) if names else None
    return (picked,)


@app.cell
def _(picked, store):
    course_rows = store.sql(
        f"""
        WITH chosen AS (
            SELECT session, greatest(duration_s / 200, 1) AS step_s FROM sessions WHERE session = '{picked.value}'
        )
        SELECT
            v.channel,
            coalesce(v.node, v.channel) AS place,
            floor(v.t_s / c.step_s) * c.step_s / 60 AS minute,
            avg(v.value) AS degC
        FROM samples AS v
        JOIN chosen AS c ON c.session = v.session
        WHERE v.session = '{picked.value}' AND v.quantity = 'temperature'
        GROUP BY ALL
        ORDER BY v.channel, minute
        """
    )
    return (course_rows,)


@app.cell
def _(COLOURS, DASHES, alt, cells, course_rows):
    courses = course_rows.to_arrow_table()
    clicked = alt.selection_point(fields=["channel"], bind="legend")
    order = list(dict.fromkeys(courses["channel"].to_pylist()))
    looks = {
        "range": [COLOURS[i % len(COLOURS)] for i in range(len(order))],
        "dash": [list(DASHES[i % len(DASHES)][1]) for i in range(len(order))],
    }
    over_time = (
        alt.Chart(courses, title="Temperatures; click a name to see it alone")
        .mark_line(strokeWidth=1.3)
        .encode(
            alt.X("minute:Q", title="time since start [min]"),
            alt.Y("degC:Q", title="°C", scale=alt.Scale(zero=False)),
            alt.Color("channel:N", title=None, scale=alt.Scale(domain=order, range=looks["range"])),
            alt.StrokeDash("channel:N", title=None, scale=alt.Scale(domain=order, range=looks["dash"])),
            opacity=alt.condition(clicked, alt.value(1.0), alt.value(0.1)),
            tooltip=["channel", "place", "minute", "degC"],
        )
        .properties(width=cells.WIDE, height=300)
        .add_params(clicked)
    )
    cells.drawn(over_time) if courses.num_rows else None
    return (over_time,)


if __name__ == "__main__":
    app.run()
