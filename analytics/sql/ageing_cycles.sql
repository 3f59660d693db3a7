-- Hours of the hottest copper channel above 180 degC: of every oven session, and of every session of a specimen that has a DC
-- check, because a hot drive ages the insulation too. Rounded here and in `dc_checks`: sums over threads differ in their last
-- bits, and `whyhot rebuild --verify` compares rows.
CREATE VIEW base.hours AS
WITH wanted AS (
    SELECT s.session, c.channel
    FROM main.sessions AS s
    JOIN main.channels AS c ON c.session = s.session
    WHERE c.quantity = 'temperature' AND c.role <> 'ignored' AND c.region = 'copper'
      AND (s.kind = 'ageing' OR s.specimen IN (SELECT o.specimen FROM main.sessions AS o WHERE o.kind = 'dc_check'))
),
steps AS (
    SELECT
        v.session, v.channel, v.value,
        lead(v.t_s) OVER (PARTITION BY v.session, v.channel ORDER BY v.t_s, v.record) - v.t_s AS step_s
    FROM main.samples AS v
    JOIN wanted AS w ON w.session = v.session AND w.channel = v.channel
    WHERE v.quantity = 'temperature' AND v.region = 'copper'  -- so that other columns are not read
)
SELECT
    session,
    channel,
    round(max(value), 6) AS highest_degC,
    round(coalesce(sum(step_s) FILTER (WHERE value > 180), 0) / 3600, 6) AS hours_above_180degC,
    round(sum(value * step_s) FILTER (WHERE value > 180) / sum(step_s) FILTER (WHERE value > 180), 6) AS mean_above_degC,
    round(max(step_s), 6) AS longest_gap_s
FROM steps
GROUP BY session, channel
QUALIFY row_number() OVER (PARTITION BY session ORDER BY max(value) DESC, channel) = 1;

CREATE VIEW ageing_cycles AS
SELECT
    s.session,
    s.name,
    s.specimen,
    s.batch,
    s.start,
    h.hours_above_180degC,
    h.highest_degC,
    h.mean_above_degC,
    h.channel AS hottest_channel,
    h.longest_gap_s,
    CASE WHEN h.session IS NULL
        THEN 'no copper temperature: no channel is of region copper' END AS why_no_hours
FROM sessions AS s
LEFT JOIN base.hours AS h ON h.session = s.session
WHERE s.kind = 'ageing'
ORDER BY s.specimen, s.start, s.name;

COMMENT ON VIEW ageing_cycles IS
    'One row an oven session (kind `ageing`): how long and how hot. An hour at 181 degC counts as one at 230 degC here, though it ages the insulation far less. Copper channels are those of region copper (see `channels`); held or stuck samples are not left out.';
COMMENT ON COLUMN ageing_cycles.session IS 'Id of the session';
COMMENT ON COLUMN ageing_cycles.name IS 'Name of the session';
COMMENT ON COLUMN ageing_cycles.specimen IS 'Which motor or stator was in the oven';
COMMENT ON COLUMN ageing_cycles.batch IS 'The batch that the specimen belongs to';
COMMENT ON COLUMN ageing_cycles.start IS 'Time of the first record, UTC; null without absolute time';
COMMENT ON COLUMN ageing_cycles.hours_above_180degC IS
    'Hours that the hottest copper channel spent above 180 degC, the limit of class H; a sample counts until the next one';
COMMENT ON COLUMN ageing_cycles.highest_degC IS 'Highest temperature of that channel';
COMMENT ON COLUMN ageing_cycles.mean_above_degC IS 'Mean temperature of that channel in those hours';
COMMENT ON COLUMN ageing_cycles.hottest_channel IS 'The copper channel with the highest temperature';
COMMENT ON COLUMN ageing_cycles.longest_gap_s IS 'Longest time between two of its samples: what happened in it is not known';
COMMENT ON COLUMN ageing_cycles.why_no_hours IS 'Why hours and temperatures are null';
