-- Hours of the hottest place of each session by temperature: of every oven session, and of every session of a specimen that was
-- checked, because a hot drive ages the insulation too. As `whyhot ageing` counts: between two samples the temperature is a
-- straight line, and a step of more than ten median steps is a gap, in which nothing is known. Rounded here and in `dc_checks`:
-- sums over threads differ in their last bits, and `whyhot rebuild --verify` compares rows.
CREATE VIEW base.hours AS
WITH wanted AS (  -- channels of copper; of a session without one, all of the specimen's own
    SELECT s.session, c.channel
    FROM main.sessions AS s
    JOIN main.channels AS c ON c.session = s.session
    WHERE c.quantity = 'temperature' AND c.role = 'observed' AND c.region IS DISTINCT FROM 'boundary'
      AND (
        s.kind = 'ageing'
        OR s.specimen IN (SELECT o.specimen FROM main.sessions AS o WHERE o.kind IN ('dc_check', 'insulation_check'))
      )
    QUALIFY c.region IS NOT DISTINCT FROM 'copper' OR NOT bool_or(c.region IS NOT DISTINCT FROM 'copper') OVER (PARTITION BY s.session)
),
hottest AS MATERIALIZED (  -- found first: the steps of one channel are put in order, not those of a dozen
    SELECT v.session, v.channel, max(v.value) AS highest
    FROM main.samples AS v
    JOIN wanted AS w ON w.session = v.session AND w.channel = v.channel
    WHERE v.quantity = 'temperature' AND v.region IS DISTINCT FROM 'boundary'  -- so that other columns are not read
    GROUP BY v.session, v.channel
    QUALIFY row_number() OVER (PARTITION BY v.session ORDER BY highest DESC, v.channel) = 1
),
steps AS MATERIALIZED (
    SELECT
        v.session, v.value,
        lead(v.value) OVER series AS next,
        lead(v.t_s) OVER series - v.t_s AS step_s
    FROM main.samples AS v
    JOIN hottest AS h ON h.session = v.session AND h.channel = v.channel
    WHERE v.quantity = 'temperature' AND v.region IS DISTINCT FROM 'boundary'
    WINDOW series AS (PARTITION BY v.session ORDER BY v.t_s, v.record)
),
gaps AS (
    SELECT session, 10 * median(step_s) FILTER (WHERE step_s > 0) AS longer_than_s
    FROM steps
    GROUP BY session
),
above AS (  -- `above_s`: how much of the step is above 180 degC, at `above_degC` on average
    SELECT
        s.session, s.step_s, s.step_s > g.longer_than_s AS is_gap,
        CASE
            WHEN s.step_s IS NULL OR s.step_s > g.longer_than_s THEN 0
            WHEN abs(s.next - s.value) < 1e-6 THEN if(s.value > 180, s.step_s, 0)
            ELSE s.step_s * greatest(0, least(1, (greatest(s.value, s.next) - 180) / abs(s.next - s.value)))
        END AS above_s,
        (greatest(s.value, s.next) + greatest(least(s.value, s.next), 180)) / 2 AS above_degC
    FROM steps AS s
    JOIN gaps AS g ON g.session = s.session
)
SELECT
    a.session,
    any_value(h.channel) AS channel,
    round(any_value(h.highest), 6) AS highest_degC,
    round(coalesce(sum(above_s), 0) / 3600, 6) AS hours_above_180degC,
    round(sum(above_degC * above_s) / nullif(sum(above_s), 0), 6) AS mean_above_degC,
    round(coalesce(sum(above_s * exp((1 / 453.15e0 - 1 / (above_degC + 273.15e0)) / 8.617333262e-5)), 0) / 3600, 6)
        AS equivalent_1eV_h,
    round(coalesce(sum(above_s * pow(2, (above_degC - 180) / 10)), 0) / 3600, 6) AS equivalent_10K_h,
    round(coalesce(sum(step_s) FILTER (WHERE is_gap), 0) / 3600, 6) AS unknown_h
FROM above AS a
JOIN hottest AS h ON h.session = a.session
GROUP BY a.session;

CREATE VIEW cycles AS
SELECT
    s.session,
    s.name,
    s.specimen,
    s.batch,
    s.start,
    s.start + to_microseconds((s.duration_s * 1e6)::BIGINT) AS "end",
    h.hours_above_180degC,
    h.equivalent_1eV_h,
    h.equivalent_10K_h,
    h.highest_degC,
    h.mean_above_degC,
    h.channel AS hottest_channel,
    h.unknown_h,
    CASE WHEN h.session IS NULL THEN 'no temperature of the specimen: every channel is of a boundary or ignored' END AS why_no_hours
FROM sessions AS s
LEFT JOIN base.hours AS h ON h.session = s.session
WHERE s.kind = 'ageing'
ORDER BY s.specimen, s.start, s.name;

COMMENT ON VIEW cycles IS
    'One row an oven session (kind `ageing`): how long and how hot. A log that holds several thermal cycles is one row with their sum; `whyhot ageing` cuts them apart. Hours are those of the hottest channel of region copper (see `channels`), without any of the specimen''s hottest place; held or stuck samples are not left out. Every step of these channels is put in order, about 100 bytes each: beyond 20 million samples in one query they wait on disk, and `hours_by_temperature`, which has the hours of assessed specimens without a log being read, is far faster.';
COMMENT ON COLUMN cycles.session IS 'Id of the session';
COMMENT ON COLUMN cycles.name IS 'Name of the session';
COMMENT ON COLUMN cycles.specimen IS 'Which motor or stator was in the oven';
COMMENT ON COLUMN cycles.batch IS 'The batch that the specimen belongs to';
COMMENT ON COLUMN cycles.start IS 'Time of the first record, UTC; null without absolute time';
COMMENT ON COLUMN cycles."end" IS 'Time of the last record, UTC';
COMMENT ON COLUMN cycles.hours_above_180degC IS
    'Hours above 180 degC, the limit of class H; an hour at 181 degC counts as one at 230 degC here, though it ages the insulation far less';
COMMENT ON COLUMN cycles.equivalent_1eV_h IS 'The same as hours at 180 degC, by Arrhenius with an activation energy of 1.0 eV';
COMMENT ON COLUMN cycles.equivalent_10K_h IS
    'The same as hours at 180 degC, by the rule that life halves every 10 K: another rule, never to be added to the first';
COMMENT ON COLUMN cycles.highest_degC IS 'Highest temperature of that channel in degC';
COMMENT ON COLUMN cycles.mean_above_degC IS 'Mean temperature of that channel in those hours, in degC';
COMMENT ON COLUMN cycles.hottest_channel IS 'The channel with the highest temperature';
COMMENT ON COLUMN cycles.unknown_h IS
    'Hours in gaps of more than ten usual steps: what happened in them is not known, they count nowhere';
COMMENT ON COLUMN cycles.why_no_hours IS 'Why hours and temperatures are null';
