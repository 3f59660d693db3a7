CREATE MACRO equivalent_hours_of(session_or_name, above_degC, at_degC, eV) AS TABLE
WITH steps AS MATERIALIZED (
    SELECT
        session, channel, node, region, value,
        lead(value) OVER series AS next,
        lead(t_s) OVER series - t_s AS step_s
    FROM samples
    WHERE quantity = 'temperature' AND NOT doubled
      AND (session = session_or_name OR session_name = session_or_name)
    WINDOW series AS (PARTITION BY session, channel ORDER BY t_s, record)
),
gaps AS (
    SELECT session, channel, 10 * median(step_s) FILTER (WHERE step_s > 0) AS longer_than_s
    FROM steps
    GROUP BY session, channel
),
above AS (
    SELECT
        s.session, s.channel, s.node, s.region, s.value,
        CASE
            WHEN s.step_s IS NULL OR s.step_s > g.longer_than_s THEN 0
            WHEN abs(s.next - s.value) < 1e-6 THEN if(s.value > above_degC, s.step_s, 0)
            ELSE s.step_s * greatest(0, least(1, (greatest(s.value, s.next) - above_degC) / abs(s.next - s.value)))
        END / 3600 AS hours,
        (greatest(s.value, s.next) + greatest(least(s.value, s.next), above_degC)) / 2 AS degC
    FROM steps AS s
    JOIN gaps AS g ON g.session = s.session AND g.channel = s.channel
)
SELECT
    session,
    channel,
    any_value(node) AS node,
    any_value(region) AS region,
    max(value) AS highest_degC,
    sum(hours) AS hours_above,
    coalesce(sum(equivalent_hours(degC, hours, at_degC, eV)), 0) AS equivalent_h,
    coalesce(sum(equivalent_hours_10K(degC, hours, at_degC)), 0) AS equivalent_10K_h
FROM above
GROUP BY session, channel
ORDER BY highest_degC DESC, channel;

COMMENT ON MACRO TABLE equivalent_hours_of IS
    'Every temperature of a session (id or name): its hours above a temperature in degC, and what they are worth as hours at another, by Arrhenius with an activation energy in eV (`equivalent_h`) and by the 10 K rule (`equivalent_10K_h`). Between two samples the temperature is a straight line; gaps of more than ten usual steps count nowhere.';
