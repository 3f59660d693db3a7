-- What is in the store
SELECT name, kind, specimen, start, round(duration_s / 60, 1) AS duration_min, channels, quarantined
FROM sessions;
