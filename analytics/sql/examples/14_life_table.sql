-- A life table: until which dose each specimen held, and by which its conductivity was down to half (null: it holds yet)
SELECT specimen, max(dose_h) FILTER (WHERE failed_by_h IS NULL OR dose_h < failed_by_h) AS held_until_h, failed_by_h
FROM (
    SELECT *, min(dose_h) FILTER (WHERE conductivity_percent <= 50) OVER (PARTITION BY specimen) AS failed_by_h
    FROM conductivity_by_cycle
)
GROUP BY specimen, failed_by_h
ORDER BY specimen;
