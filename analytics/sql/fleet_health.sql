CREATE VIEW fleet_health AS
SELECT
    v.specimen,
    v.batch,
    v.checks,
    v.dose_h,
    v.form,
    v.form_probability,
    v.significant,
    v.slope_percent_per_100h,
    v.slope_low,
    v.slope_high,
    v.fleet_slope_percent_per_100h,
    v.fleet_slope_sd,
    v.repeatability_percent,
    v.score,
    v.outlying,
    v.remaining_low_h,
    v.remaining_high_h,
    v.why,
    a.run AS assessment
FROM base.ageing_specimens AS v
JOIN base.artefacts AS a ON a.file = v.file
ORDER BY v.score DESC NULLS LAST, v.specimen;

COMMENT ON VIEW fleet_health IS
    'One row a specimen of the latest `whyhot ageing`, those that age fastest beyond the others first. Empty before the first assessment.';
COMMENT ON COLUMN fleet_health.specimen IS 'Which motor or stator';
COMMENT ON COLUMN fleet_health.batch IS 'The batch that it belongs to';
COMMENT ON COLUMN fleet_health.checks IS 'Number of its checks';
COMMENT ON COLUMN fleet_health.dose_h IS 'Hours above the threshold (180 degC) at its last check';
COMMENT ON COLUMN fleet_health.form IS 'none, monotone, dip_then_rise or changepoint: the form of the path of the resistance over the dose. Of a large fleet some courses are weighed only: null of the others, and so are significant and the slope';
COMMENT ON COLUMN fleet_health.form_probability IS 'How probable that form is';
COMMENT ON COLUMN fleet_health.significant IS 'True where repeatability alone does not explain what was seen';
COMMENT ON COLUMN fleet_health.slope_percent_per_100h IS 'Change of the resistance in percent per 100 h of dose in its last branch; positive is worse';
COMMENT ON COLUMN fleet_health.slope_low IS 'Lower end of 95 % of that';
COMMENT ON COLUMN fleet_health.slope_high IS 'Upper end of 95 % of that';
COMMENT ON COLUMN fleet_health.fleet_slope_percent_per_100h IS 'The slope that the specimen and its fleet together say, in percent per 100 h: one with few checks borrows from the rest';
COMMENT ON COLUMN fleet_health.fleet_slope_sd IS 'Its standard deviation in percent per 100 h';
COMMENT ON COLUMN fleet_health.repeatability_percent IS 'How well checks repeat: one standard deviation in percent';
COMMENT ON COLUMN fleet_health.score IS 'How far the slope is from the fleet''s, in standard deviations';
COMMENT ON COLUMN fleet_health.outlying IS 'True where it stands out, by the false discovery rate that the assessment states';
COMMENT ON COLUMN fleet_health.remaining_low_h IS 'Dose in hours until the criterion of end of life that the assessment names, lower end of 90 %; null where it is not reached';
COMMENT ON COLUMN fleet_health.remaining_high_h IS 'Upper end of 90 %; null where it is not reached';
COMMENT ON COLUMN fleet_health.why IS 'What could not be told of it, and why';
COMMENT ON COLUMN fleet_health.assessment IS 'Id of the assessment that says so: the latest one';
