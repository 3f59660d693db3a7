CREATE MACRO resample(session_or_name, channel_name, seconds) AS TABLE
SELECT
    session,
    channel,
    floor(t_s / seconds) * seconds AS t_s,
    avg(value) AS mean,
    min(value) AS lowest,
    max(value) AS highest,
    count(*) AS samples,
    any_value(unit) AS unit
FROM samples
WHERE channel = channel_name AND NOT doubled
  AND (session = session_or_name OR session_name = session_or_name)
GROUP BY ALL
ORDER BY session, t_s;

COMMENT ON MACRO TABLE resample IS
    'A channel of a session (id or name) in steps of so many seconds: mean, lowest, highest and number of its samples.';
