-- The dose of each specimen: hours above 180 degC in the oven, and what they are worth at 180 degC by either rule
SELECT
    specimen,
    sum(hours_above_180degC) AS dose_h,
    sum(equivalent_1eV_h) AS equivalent_1eV_h,
    sum(equivalent_10K_h) AS equivalent_10K_h,
    sum(unknown_h) AS unknown_h
FROM cycles
GROUP BY specimen
ORDER BY dose_h DESC;
