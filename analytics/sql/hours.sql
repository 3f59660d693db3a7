-- Hours of the hottest place of each session that is asked for, by temperature: a hot drive ages the insulation too. As
-- `whyhot ageing` counts: between two samples the temperature is a straight line, and a step of more than ten median steps
-- is a gap, in which nothing is known. Rounded here and in `measured_checks`: sums over threads differ in their last bits.
WITH wanted AS (  -- channels of copper; of a session without one, all of the specimen's own
    SELECT a.session, c.channel
    FROM base.asked AS a
    JOIN main.channels AS c ON c.session = a.session
    WHERE c.quantity = 'temperature' AND c.role = 'observed' AND c.region IS DISTINCT FROM 'boundary'
    QUALIFY c.region IS NOT DISTINCT FROM 'copper' OR NOT bool_or(c.region IS NOT DISTINCT FROM 'copper') OVER (PARTITION BY a.session)
),
hottest AS MATERIALIZED (  -- found first: the steps of one channel are put in order, not those of a dozen
    SELECT v.session, v.channel, max(v.value) AS highest
    FROM main.samples AS v
    JOIN wanted AS w ON w.session = v.session AND w.channel = v.channel
    WHERE v.quantity = 'temperature' AND v.region IS DISTINCT FROM 'boundary'  -- so that other columns are not read
      AND NOT v.doubled
    GROUP BY v.session, v.channel
    QUALIFY row_number() OVER (PARTITION BY v.session ORDER BY highest DESC, v.channel) = 1
),
steps AS MATERIALIZED (
    SELECT
        v.session, v.t_ns, v.value,
        lead(v.value) OVER series AS next,
        lead(v.t_s) OVER series - v.t_s AS step_s
    FROM main.samples AS v
    JOIN hottest AS h ON h.session = v.session AND h.channel = v.channel
    WHERE v.quantity = 'temperature' AND v.region IS DISTINCT FROM 'boundary' AND NOT v.doubled
    WINDOW series AS (PARTITION BY v.session ORDER BY v.t_s, v.record)
),
gaps AS (
    SELECT session, 10 * median(step_s) FILTER (WHERE step_s > 0) AS longer_than_s
    FROM steps
    GROUP BY session
),
above AS (  -- `above_s`: how much of the step is above 180 degC, at `above_degC` on average, and whether its end is
    SELECT
        s.session, s.t_ns, s.next > s.value AS rises, s.step_s, s.step_s > g.longer_than_s AS is_gap,
        CASE
            WHEN s.step_s IS NULL OR s.step_s > g.longer_than_s THEN 0
            WHEN abs(s.next - s.value) < 1e-6 THEN if(s.value > 180, s.step_s, 0)
            ELSE s.step_s * greatest(0, least(1, (greatest(s.value, s.next) - 180) / abs(s.next - s.value)))
        END AS above_s,
        (greatest(s.value, s.next) + greatest(least(s.value, s.next), 180)) / 2 AS above_degC
    FROM steps AS s
    JOIN gaps AS g ON g.session = s.session
),
stays AS (  -- a step that rises is above 180 degC at its end, one that falls at its beginning
    SELECT session, from_ns, to_ns, coalesce(from_ns > lag(to_ns) OVER series + 1, false) AS anew
    FROM (
        SELECT session, t_ns + round(1e9 * if(rises, step_s - above_s, 0))::BIGINT AS from_ns,
            t_ns + round(1e9 * if(rises, step_s, above_s))::BIGINT AS to_ns
        FROM above
        WHERE above_s > 0
    )
    WINDOW series AS (PARTITION BY session ORDER BY from_ns)
),
stayed AS (
    SELECT session, list({'from_ns': from_ns, 'to_ns': to_ns} ORDER BY from_ns) AS above
    FROM (
        SELECT session, min(from_ns) AS from_ns, max(to_ns) AS to_ns
        FROM (SELECT *, sum(anew::INTEGER) OVER (PARTITION BY session ORDER BY from_ns) AS number FROM stays)
        GROUP BY session, number
    )
    GROUP BY session
)
SELECT
    a.session,
    any_value(h.channel) AS channel,
    round(any_value(h.highest), 6) AS highest_degC,
    round(coalesce(sum(above_s), 0) / 3600, 6) AS hours_above_180degC,
    round(sum(above_degC * above_s) / nullif(sum(above_s), 0), 6) AS mean_above_degC,
    round(coalesce(sum(above_s * exp((1 / 453.15e0 - 1 / (above_degC + 273.15e0)) / 8.617333262e-5)), 0) / 3600, 6)
        AS equivalent_1eV_h,
    round(coalesce(sum(above_s * pow(2, (above_degC - 180) / 10)), 0) / 3600, 6) AS equivalent_10K_h,
    round(coalesce(sum(step_s) FILTER (WHERE is_gap), 0) / 3600, 6) AS unknown_h,
    any_value(s.above) AS above
FROM above AS a
JOIN hottest AS h ON h.session = a.session
LEFT JOIN stayed AS s ON s.session = a.session
GROUP BY a.session
