CREATE VIEW oven_cycles AS
SELECT
    v.specimen,
    v.batch,
    v.number,
    v.session,
    v.session_name,
    v.channel,
    CASE WHEN v.start_ns IS NOT NULL
        THEN make_timestamp_ns(v.start_ns + (v.soak_from_s * 1e9)::BIGINT)::TIMESTAMP END AS soak_start,
    (v.soak_from_s - v.heating_from_s) / 3600 AS heating_h,
    (v.soak_to_s - v.soak_from_s) / 3600 AS soak_h,
    (v.cooling_to_s - v.soak_to_s) / 3600 AS cooling_h,
    v.soak_degC,
    v.highest_degC,
    v.hours_above AS hours_above_180degC,
    v.unknown_h,
    v.swing_K,
    v.heating_K_per_min,
    v.cooling_K_per_min,
    a.run AS assessment
FROM base.ageing_cycles AS v
JOIN base.artefacts AS a ON a.file = v.file;  -- in the order of the file, by specimen and number: a fleet is not sorted again

COMMENT ON VIEW oven_cycles IS
    'One row a thermal cycle of the specimens of the latest `whyhot ageing`, cut from the temperature itself: a log may hold several. A cycle exceeds 180 degC by 2 K and ends 20 K below it; `cycles` has the hours of whole sessions. Empty before the first assessment.';
COMMENT ON COLUMN oven_cycles.specimen IS 'Which motor or stator was in the oven';
COMMENT ON COLUMN oven_cycles.batch IS 'The batch that the specimen belongs to';
COMMENT ON COLUMN oven_cycles.number IS 'Counts the cycles of the specimen over all its sessions, from 1';
COMMENT ON COLUMN oven_cycles.session IS 'Id of the session that holds it';
COMMENT ON COLUMN oven_cycles.session_name IS 'Name of that session';
COMMENT ON COLUMN oven_cycles.channel IS 'The hottest copper channel of the session';
COMMENT ON COLUMN oven_cycles.soak_start IS 'When the soak begins, UTC; null without absolute time';
COMMENT ON COLUMN oven_cycles.heating_h IS 'Hours from where the trace leaves its lowest to the soak; null where the log begins later';
COMMENT ON COLUMN oven_cycles.soak_h IS 'Hours near the level of the soak, gaps included';
COMMENT ON COLUMN oven_cycles.cooling_h IS 'Hours from the soak to the lowest after it; null where the log ends sooner';
COMMENT ON COLUMN oven_cycles.soak_degC IS 'Mean temperature of the soak';
COMMENT ON COLUMN oven_cycles.highest_degC IS 'Highest temperature of the cycle';
COMMENT ON COLUMN oven_cycles.hours_above_180degC IS 'Hours above 180 degC, as far as known';
COMMENT ON COLUMN oven_cycles.unknown_h IS 'Hours of it that lie in gaps of the log';
COMMENT ON COLUMN oven_cycles.swing_K IS 'How severe a thermal shock it is: highest minus lowest temperature of the cycle in K';
COMMENT ON COLUMN oven_cycles.heating_K_per_min IS 'Fastest heating in K/min, a mean over 5 min (as IEC 60068-2-14 states rates); null where the log begins later';
COMMENT ON COLUMN oven_cycles.cooling_K_per_min IS 'Fastest cooling in K/min, a mean over 5 min; null where the log ends sooner';
COMMENT ON COLUMN oven_cycles.assessment IS 'Id of the assessment that says so: the latest one';
