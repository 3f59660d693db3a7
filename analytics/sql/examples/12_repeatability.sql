-- How well checks repeat on each rig: those of one specimen within the same hour of dose
SELECT bench, sum(n - 1) AS repeats, 100 * sqrt(sum(squares) / sum(n - 1)) AS repeatability_percent
FROM (
    SELECT s.bench, count(*) AS n, var_pop(ln(c.resistance_K_per_W)) * count(*) AS squares
    FROM conductivity_by_cycle AS c
    LEFT JOIN sessions AS s ON s.session = c.session
    WHERE c.resistance_K_per_W IS NOT NULL AND c.dose_h IS NOT NULL
    GROUP BY s.bench, c.specimen, round(c.dose_h)
    HAVING n > 1
)
GROUP BY bench;
