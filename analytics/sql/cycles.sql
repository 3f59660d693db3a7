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
    'One row an oven session (kind `ageing`): how long and how hot. A log that holds several thermal cycles is one row with their sum; `whyhot ageing` cuts them apart. Hours are those of the hottest channel of region copper (see `channels`), without any of the specimen''s hottest place; held or stuck samples are not left out. A log is read once, when the first question after it is asked; what it says is kept in the store''s `warehouse/`.';
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
