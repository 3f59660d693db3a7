-- What each electrical check of the insulation that is asked for has measured.
WITH by_channel AS (
    SELECT
        v.session, v.channel, v.quantity,
        last(v.value ORDER BY v.t_ns, v.record) AS latest,
        median(v.value) AS middle
    FROM samples AS v
    JOIN channels AS c ON c.session = v.session AND c.channel = v.channel
    JOIN base.asked AS s ON s.session = v.session
    WHERE c.role <> 'ignored'
      AND v.quantity IN (
        'insulation_resistance', 'polarisation_index', 'capacitance', 'tan_delta', 'inception_voltage', 'temperature'
      )
    GROUP BY v.session, v.channel, v.quantity
)
SELECT
    session,
    min(latest) FILTER (WHERE quantity = 'insulation_resistance') AS insulation_resistance_ohm,
    min(latest) FILTER (WHERE quantity = 'polarisation_index') AS polarisation_index,
    median(middle) FILTER (WHERE quantity = 'capacitance') AS capacitance_F,
    max(middle) FILTER (WHERE quantity = 'tan_delta') AS tan_delta,
    min(middle) FILTER (WHERE quantity = 'inception_voltage') AS inception_voltage_V,
    median(middle) FILTER (WHERE quantity = 'temperature') AS temperature_degC
FROM by_channel
GROUP BY session
