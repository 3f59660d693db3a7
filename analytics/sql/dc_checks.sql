-- Hours above 180 degC of a specimen before each of its checks.
CREATE VIEW base.doses AS
SELECT
    c.session,
    CASE WHEN NOT unknown THEN round(dose, 6) END AS dose_h,
    CASE
        WHEN c.specimen IS NULL THEN 'no specimen is named'
        WHEN c.start IS NULL THEN 'no absolute time'
        WHEN unknown THEN 'an oven session of the specimen has no hours or no absolute time'
    END AS why
FROM main.sessions AS c
LEFT JOIN (
    SELECT
        c.session,
        coalesce(sum(h.hours_above_180degC) FILTER (WHERE e.start < c.start), 0) AS dose,
        bool_or(e.kind = 'ageing' AND (e.start IS NULL OR (e.start < c.start AND h.session IS NULL))) AS unknown
    FROM main.sessions AS c
    JOIN main.sessions AS e ON e.specimen = c.specimen
    LEFT JOIN base.hours AS h ON h.session = e.session
    WHERE c.kind IN ('dc_check', 'insulation_check') AND c.start IS NOT NULL
    GROUP BY c.session
) AS d ON d.session = c.session
WHERE c.kind IN ('dc_check', 'insulation_check');

-- The last 20 min of load of each check in two halves: the later one gives the numbers, the change between them says whether
-- they are steady. A half is 10 min so that a coolant controller that swings over minutes averages out.
CREATE VIEW dc_checks AS
WITH wanted AS (
    SELECT s.session, c.channel, CASE c.quantity
        WHEN 'temperature' THEN c.region
        WHEN 'power' THEN 'power'
        WHEN 'current' THEN 'current' WHEN 'current_dc' THEN 'current'
        WHEN 'voltage' THEN 'voltage' WHEN 'voltage_dc' THEN 'voltage'
    END AS what
    FROM sessions AS s
    JOIN channels AS c ON c.session = s.session
    WHERE s.kind = 'dc_check' AND c.role <> 'ignored'
),
measured AS (
    SELECT v.session, w.what, v.channel, v.t_s, if(w.what IN ('current', 'voltage'), abs(v.value), v.value) AS value
    FROM samples AS v
    JOIN wanted AS w ON w.session = v.session AND w.channel = v.channel
    WHERE w.what IN ('copper', 'iron', 'power', 'current', 'voltage')
      AND v.quantity IN ('temperature', 'power', 'current', 'current_dc', 'voltage', 'voltage_dc')
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
      AND v.session IN (SELECT session FROM channels WHERE quantity = 'thermal_resistance' AND role <> 'ignored')
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
                THEN 'no copper temperature: no channel is of region copper'
            WHEN any_value(v.iron_degC) IS NULL
                THEN 'no iron temperature: no channel is of region iron'
            WHEN any_value(v.power_W) IS NULL THEN 'neither power nor voltage is recorded'
            WHEN any_value(v.power_W) <= 0 THEN 'power is not above zero'
            WHEN any_value(v.copper_degC) <= any_value(v.iron_degC) THEN 'copper is not warmer than iron'
            WHEN any_value(abs(v.drift)) > 1 OR any_value(v.drift) IS NULL
                THEN format('not steady: changes by {:.1f} % in 10 min, 1 % is allowed', any_value(v.drift))
        END AS why
    FROM sessions AS s
    LEFT JOIN loaded AS l ON l.session = s.session
    LEFT JOIN evaluated AS v ON v.session = s.session
    WHERE s.kind = 'dc_check'
    GROUP BY s.session
)
SELECT
    s.session,
    s.name,
    s.specimen,
    s.batch,
    if(s.start IS NULL OR g.session IS NULL, s.start, make_timestamp_ns(g.t_ns)::TIMESTAMP) AS start,
    coalesce(g.dose_h, d.dose_h) AS dose_h,
    CASE WHEN g.session IS NOT NULL THEN g.resistance WHEN r.why IS NULL THEN round(v.resistance, 9) END AS resistance_K_per_W,
    round(v.copper_degC, 6) AS copper_degC,
    round(v.iron_degC, 6) AS iron_degC,
    round(v.power_W, 6) AS power_W,
    round(v.drift, 6) AS drift_percent,
    round(l.load_s, 6) AS load_s,
    CASE WHEN g.session IS NULL THEN r.why END AS why_no_resistance,
    CASE WHEN g.dose_h IS NULL THEN d.why END AS why_no_dose,
    CASE WHEN g.session IS NOT NULL THEN 'given in a table' WHEN v.power_W IS NOT NULL THEN v.power_from END AS power_from,
    v.copper_from,
    v.iron_from,
    g.record
FROM sessions AS s
JOIN reasons AS r ON r.session = s.session
JOIN base.doses AS d ON d.session = s.session
LEFT JOIN given AS g ON g.session = s.session
LEFT JOIN loaded AS l ON l.session = s.session
LEFT JOIN evaluated AS v ON v.session = s.session
WHERE s.kind = 'dc_check'
ORDER BY s.specimen, start, dose_h, s.name, g.record;

COMMENT ON VIEW dc_checks IS
    'One row a DC check: the thermal resistance of the stator''s insulation; of a table of checks that were evaluated elsewhere, one row each of its rows. Steady: at least 20 min of load without a break, and the resistance over the last 10 min within 1 % of that over the 10 min before. Copper and iron channels are those of these regions (see `channels`); held or stuck samples are not left out. One value holds enamel, resin, liner and the sensors'' places together: compare it with other checks of the same specimen and channels only.';
COMMENT ON COLUMN dc_checks.session IS 'Id of the session';
COMMENT ON COLUMN dc_checks.name IS 'Name of the session';
COMMENT ON COLUMN dc_checks.specimen IS 'Which motor or stator was checked';
COMMENT ON COLUMN dc_checks.batch IS 'The batch that the specimen belongs to';
COMMENT ON COLUMN dc_checks.start IS 'Time of the first record, UTC; null without absolute time';
COMMENT ON COLUMN dc_checks.dose_h IS
    'Hours of the hottest copper channel above 180 degC, summed over the specimen''s earlier sessions, whatever their kind; where a table gives the dose, that';
COMMENT ON COLUMN dc_checks.resistance_K_per_W IS '(copper_degC - iron_degC) / power_W in K/W, or as a table gives it; null where it is not steady or something is missing';
COMMENT ON COLUMN dc_checks.copper_degC IS 'Mean of the copper channels over the last 10 min of load';
COMMENT ON COLUMN dc_checks.iron_degC IS 'Mean of the iron channels over the last 10 min of load';
COMMENT ON COLUMN dc_checks.power_W IS 'Mean electrical power over the last 10 min of load: V I';
COMMENT ON COLUMN dc_checks.drift_percent IS 'Change of the resistance from the 10 min before to the last 10 min of load';
COMMENT ON COLUMN dc_checks.load_s IS 'How long the load was on without a break before it ended; on: above half of its 99.5 % quantile';
COMMENT ON COLUMN dc_checks.why_no_resistance IS 'Why the resistance is null';
COMMENT ON COLUMN dc_checks.why_no_dose IS 'Why the dose is null';
COMMENT ON COLUMN dc_checks.power_from IS
    'power (a channel of it), else voltage x current, of several channels the largest; `given in a table` where the resistance is';
COMMENT ON COLUMN dc_checks.copper_from IS 'The copper channels';
COMMENT ON COLUMN dc_checks.iron_from IS 'The iron channels';
COMMENT ON COLUMN dc_checks.record IS 'Row of the table that gives it, from 0; null for a log';
