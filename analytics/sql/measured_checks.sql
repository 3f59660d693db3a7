-- The last 20 min of load of each check that is asked for in two halves: the later one gives the numbers, the change between them says whether
-- they are steady. A half is 10 min so that a coolant controller that swings over minutes averages out.
WITH wanted AS (
    SELECT s.session, c.channel, CASE c.quantity
        WHEN 'temperature' THEN c.region
        WHEN 'power' THEN 'power'
        WHEN 'current' THEN 'current' WHEN 'current_dc' THEN 'current'
        WHEN 'voltage' THEN 'voltage' WHEN 'voltage_dc' THEN 'voltage'
    END AS what
    FROM base.asked AS s
    JOIN channels AS c ON c.session = s.session
    WHERE c.role <> 'ignored'
),
measured AS (
    SELECT v.session, w.what, v.channel, v.t_s, if(w.what IN ('current', 'voltage'), abs(v.value), v.value) AS value
    FROM samples AS v
    JOIN wanted AS w ON w.session = v.session AND w.channel = v.channel
    WHERE w.what IN ('copper', 'iron', 'power', 'current', 'voltage')
      AND v.quantity IN ('temperature', 'power', 'current', 'current_dc', 'voltage', 'voltage_dc')
      AND NOT v.doubled
),
load AS (  -- the channel that tells when the load is on: current, else power; of several the largest
    SELECT session, channel, quantile_cont(abs(value), 0.995) / 2 AS half
    FROM measured
    WHERE what IN ('current', 'power')
    GROUP BY session, what, channel
    QUALIFY row_number() OVER (PARTITION BY session ORDER BY what, half DESC, channel) = 1
),
switched AS (
    SELECT
        m.session, m.t_s, abs(m.value) > l.half AS is_on,
        max(m.t_s) FILTER (WHERE abs(m.value) > l.half) OVER (PARTITION BY m.session) AS until_s
    FROM measured AS m
    JOIN load AS l ON l.session = m.session AND l.channel = m.channel
),
loaded AS (  -- the last stretch without a break
    SELECT
        session, any_value(until_s) AS until_s,
        coalesce(any_value(until_s) - coalesce(max(t_s) FILTER (WHERE NOT is_on AND t_s < until_s), min(t_s)), 0) AS load_s
    FROM switched
    GROUP BY session
),
halves AS (
    SELECT
        m.session, m.what, m.channel,
        avg(m.value) FILTER (WHERE m.t_s <= l.until_s - 600) AS early,
        avg(m.value) FILTER (WHERE m.t_s > l.until_s - 600) AS late
    FROM measured AS m
    JOIN loaded AS l ON l.session = m.session AND m.t_s > l.until_s - 1200 AND m.t_s <= l.until_s
    GROUP BY m.session, m.what, m.channel
    HAVING early IS NOT NULL AND late IS NOT NULL
),
means AS (
    SELECT
        session,
        avg(late) FILTER (WHERE what = 'copper') AS copper_degC,
        avg(late) FILTER (WHERE what = 'iron') AS iron_degC,
        avg(early) FILTER (WHERE what = 'copper') - avg(early) FILTER (WHERE what = 'iron') AS early_K,
        coalesce(
            max(late) FILTER (WHERE what = 'power'),
            max(late) FILTER (WHERE what = 'voltage') * max(late) FILTER (WHERE what = 'current')
        ) AS power_W,
        coalesce(
            max(early) FILTER (WHERE what = 'power'),
            max(early) FILTER (WHERE what = 'voltage') * max(early) FILTER (WHERE what = 'current')
        ) AS early_W,
        if(bool_or(what = 'power'), 'power', 'voltage x current') AS power_from,
        string_agg(channel, ', ' ORDER BY channel) FILTER (WHERE what = 'copper') AS copper_from,
        string_agg(channel, ', ' ORDER BY channel) FILTER (WHERE what = 'iron') AS iron_from
    FROM halves
    GROUP BY session
),
evaluated AS (
    SELECT
        *,
        (copper_degC - iron_degC) / power_W AS resistance,
        100 * ((copper_degC - iron_degC) / power_W / (early_K / early_W) - 1) AS drift
    FROM means
),
given AS (  -- rows of a table of checks that were evaluated elsewhere, of which a session may hold several
    SELECT
        v.session,
        v.record,
        any_value(v.t_ns) AS t_ns,
        any_value(v.value) FILTER (WHERE v.quantity = 'thermal_resistance') AS resistance,
        any_value(v.value) FILTER (WHERE v.quantity = 'dose') AS dose_h
    FROM samples AS v
    WHERE v.quantity IN ('thermal_resistance', 'dose')
      AND v.session IN (
        SELECT c.session
        FROM base.asked AS a
        JOIN channels AS c ON c.session = a.session
        WHERE c.quantity = 'thermal_resistance' AND c.role <> 'ignored'
      )
    GROUP BY v.session, v.file_id, v.record
    HAVING resistance IS NOT NULL
),
reasons AS (
    SELECT
        s.session,
        CASE
            WHEN any_value(l.session) IS NULL THEN 'no power or current is recorded'
            WHEN any_value(l.load_s) < 1200
                THEN format('loaded for {:.1f} min without a break, 20 min are needed', floor(any_value(l.load_s) / 6) / 10)
            WHEN any_value(v.copper_degC) IS NULL
                THEN 'no copper temperature: no channel of region copper has one'
            WHEN any_value(v.iron_degC) IS NULL
                THEN 'no iron temperature: no channel of region iron has one'
            WHEN any_value(v.power_W) IS NULL THEN 'neither power nor voltage is recorded'
            WHEN any_value(v.power_W) <= 0 THEN 'power is not above zero'
            WHEN any_value(v.copper_degC) <= any_value(v.iron_degC) THEN 'copper is not warmer than iron'
            WHEN any_value(abs(v.drift)) > 1 OR any_value(v.drift) IS NULL
                THEN format('not steady: changes by {:.1f} % in 10 min, 1 % is allowed', any_value(v.drift))
        END AS why
    FROM base.asked AS s
    LEFT JOIN loaded AS l ON l.session = s.session
    LEFT JOIN evaluated AS v ON v.session = s.session
    GROUP BY s.session
)
SELECT
    s.session,
    g.record,
    g.t_ns,
    g.dose_h,
    CASE WHEN g.session IS NOT NULL THEN g.resistance WHEN r.why IS NULL THEN round(v.resistance, 9) END AS resistance_K_per_W,
    round(v.copper_degC, 6) AS copper_degC,
    round(v.iron_degC, 6) AS iron_degC,
    round(v.power_W, 6) AS power_W,
    round(v.drift, 6) AS drift_percent,
    round(l.load_s, 6) AS load_s,
    CASE WHEN g.session IS NULL THEN r.why END AS why_no_resistance,
    CASE WHEN g.session IS NOT NULL THEN 'given in a table' WHEN v.power_W IS NOT NULL THEN v.power_from END AS power_from,
    v.copper_from,
    v.iron_from
FROM base.asked AS s
JOIN reasons AS r ON r.session = s.session
LEFT JOIN given AS g ON g.session = s.session
LEFT JOIN loaded AS l ON l.session = s.session
LEFT JOIN evaluated AS v ON v.session = s.session
