-- What every specimen's heat is worth at 180 degC, by two rules that are never mixed
SELECT
    specimen,
    round(sum(equivalent_hours(degC, hours, 180, 1.0)), 1) AS by_1eV_h,
    round(sum(equivalent_hours_10K(degC, hours, 180)), 1) AS by_10K_h
FROM hours_by_temperature
GROUP BY specimen
ORDER BY by_1eV_h DESC;
