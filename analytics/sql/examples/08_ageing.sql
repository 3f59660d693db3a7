-- How the insulation of each specimen changes: hours above 180 degC in the oven, and the trend of its thermal resistance
SELECT
    a.specimen,
    a.oven_sessions,
    a.above_180degC_h,
    count(d.resistance_K_per_W) AS checks,
    1e4 * regr_slope(ln(d.resistance_K_per_W), d.dose_h) AS slope_percent_per_100h
FROM (
    SELECT specimen, count(*) AS oven_sessions, sum(hours_above_180degC) AS above_180degC_h
    FROM cycles
    GROUP BY specimen
) AS a
LEFT JOIN dc_checks AS d ON d.specimen = a.specimen
GROUP BY ALL
ORDER BY a.specimen;
