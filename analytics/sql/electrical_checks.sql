-- What each electrical check of the insulation that is asked for has measured. Values an hour apart are of several
-- checks, as a table holds one a row: `t_ns` is when each began, null of the first, which began as its session did.
WITH measured AS (
    SELECT
        v.session, v.channel, v.quantity, v.value, v.record, v.t_ns,
        coalesce(v.t_ns - lag(v.t_ns) OVER (PARTITION BY v.session ORDER BY v.t_ns) > 3_600_000_000_000, false) AS anew
    FROM samples AS v
    JOIN channels AS c ON c.session = v.session AND c.channel = v.channel
    JOIN base.asked AS s ON s.session = v.session
    WHERE c.role <> 'ignored'
      AND v.quantity IN (
        'insulation_resistance', 'polarisation_index', 'capacitance', 'tan_delta', 'inception_voltage', 'temperature'
      )
),
numbered AS (
    SELECT *, sum(anew::INTEGER) OVER (PARTITION BY session ORDER BY t_ns) AS number
    FROM measured
),
by_channel AS (
    SELECT
        session, number, channel, quantity,
        min(t_ns) AS t_ns,
        last(value ORDER BY t_ns, record) AS latest,
        median(value) AS middle
    FROM numbered
    GROUP BY session, number, channel, quantity
)
SELECT
    session,
    CASE WHEN number > 0 THEN min(t_ns) END AS t_ns,
    min(latest) FILTER (WHERE quantity = 'insulation_resistance') AS insulation_resistance_ohm,
    min(latest) FILTER (WHERE quantity = 'polarisation_index') AS polarisation_index,
    median(middle) FILTER (WHERE quantity = 'capacitance') AS capacitance_F,
    max(middle) FILTER (WHERE quantity = 'tan_delta') AS tan_delta,
    min(middle) FILTER (WHERE quantity = 'inception_voltage') AS inception_voltage_V,
    median(middle) FILTER (WHERE quantity = 'temperature') AS temperature_degC
FROM by_channel
GROUP BY session, number
