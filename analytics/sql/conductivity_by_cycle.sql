CREATE VIEW conductivity_by_cycle AS
SELECT
    v.specimen,
    v.batch,
    v.number,
    v.session_name,
    make_timestamp_ns(v.start_ns)::TIMESTAMP AS start,
    v.dose_h,
    v.cycles,
    v.discharge_h,
    v.equivalent_low_h,
    v.equivalent_high_h,
    v.conductivity_percent,
    v.resistance_K_per_W,
    v.sd_K_per_W,
    v.sd_percent,
    v.source,
    v.state,
    v.why,
    v.hottest_channel,
    v.hottest_degC,
    v.session,
    a.run AS assessment
FROM base.ageing_checks AS v
JOIN base.artefacts AS a ON a.file = v.file;  -- in no order: sorting takes three times as long as reading

COMMENT ON VIEW conductivity_by_cycle IS
    'One row a check of the latest `whyhot ageing`: what the insulation still conducts, cycle after cycle. Empty before the first assessment. Set it against a dose, never against the number of the cycle: cycles differ in length.';
COMMENT ON COLUMN conductivity_by_cycle.specimen IS 'Which motor or stator';
COMMENT ON COLUMN conductivity_by_cycle.batch IS 'The batch that it belongs to';
COMMENT ON COLUMN conductivity_by_cycle.number IS 'Number of the check of its specimen';
COMMENT ON COLUMN conductivity_by_cycle.session_name IS 'Name of its session';
COMMENT ON COLUMN conductivity_by_cycle.start IS 'When, UTC; null without absolute time';
COMMENT ON COLUMN conductivity_by_cycle.dose_h IS 'Hours above the threshold (180 degC) before the check';
COMMENT ON COLUMN conductivity_by_cycle.cycles IS 'Thermal cycles before the check; null of a row of a table';
COMMENT ON COLUMN conductivity_by_cycle.discharge_h IS 'Hours before the check in which a test voltage was above the inception voltage that the electrical check before had measured; null of a row of a table, and where none had';
COMMENT ON COLUMN conductivity_by_cycle.equivalent_low_h IS 'The same dose as hours at the threshold, the least over the rules that the assessment states, each end by one rule';
COMMENT ON COLUMN conductivity_by_cycle.equivalent_high_h IS 'The most over the rules that the assessment states, each end by one rule';
COMMENT ON COLUMN conductivity_by_cycle.conductivity_percent IS 'Equivalent conductivity of the insulation, 1 / resistance, in percent of the specimen''s first';
COMMENT ON COLUMN conductivity_by_cycle.resistance_K_per_W IS 'Thermal resistance from copper to iron in K/W; null where the check cannot tell it';
COMMENT ON COLUMN conductivity_by_cycle.sd_K_per_W IS 'Its standard deviation in K/W, of this check alone: repeatability is not in it';
COMMENT ON COLUMN conductivity_by_cycle.sd_percent IS 'Standard deviation of the resistance in percent, with what checks repeat by: what courses and fleets are weighed with';
COMMENT ON COLUMN conductivity_by_cycle.source IS 'What the resistance was taken from, in order of trust: an iron sensor, the first minutes of heating and cooling, ambient; or a table';
COMMENT ON COLUMN conductivity_by_cycle.state IS 'Whether steady state was reached, or extrapolated';
COMMENT ON COLUMN conductivity_by_cycle.why IS 'Why there is no resistance, or no dose';
COMMENT ON COLUMN conductivity_by_cycle.hottest_channel IS 'Hottest channel of the check';
COMMENT ON COLUMN conductivity_by_cycle.hottest_degC IS 'Its temperature in degC';
COMMENT ON COLUMN conductivity_by_cycle.session IS 'Id of the session';
COMMENT ON COLUMN conductivity_by_cycle.assessment IS 'Id of the assessment that says so: the latest one';
