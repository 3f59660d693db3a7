-- Hours that each specimen spent above 180 degC in the oven
WITH steps AS (
    SELECT session, value, lead(t_s) OVER (PARTITION BY session, channel ORDER BY t_s) - t_s AS step_s
    FROM samples
    WHERE node = 'oven'
)
SELECT s.specimen, s.batch, sum(step_s) FILTER (WHERE value > 180) / 3600 AS above_180degC_h
FROM steps
JOIN sessions AS s USING (session)
WHERE s.kind = 'ageing'
GROUP BY ALL
ORDER BY s.specimen;
