CREATE VIEW changepoints AS
SELECT
    v.specimen,
    v.batch,
    v.change_at_dose_h,
    v.form,
    v.form_probability,
    v.slope_percent_per_100h,
    v.slope_low,
    v.slope_high,
    v.significant,
    a.run AS assessment
FROM base.ageing_specimens AS v
JOIN base.artefacts AS a ON a.file = v.file
WHERE v.change_at_dose_h IS NOT NULL
ORDER BY v.specimen;

COMMENT ON VIEW changepoints IS
    'One row a specimen of the latest `whyhot ageing` whose resistance turns at some dose. Empty before the first assessment.';
COMMENT ON COLUMN changepoints.specimen IS 'Which motor or stator';
COMMENT ON COLUMN changepoints.batch IS 'The batch that it belongs to';
COMMENT ON COLUMN changepoints.change_at_dose_h IS 'Dose in hours at which the path turns; null for a form without turn';
COMMENT ON COLUMN changepoints.form IS 'none, monotone, dip_then_rise or changepoint: the form of the path of the resistance over the dose';
COMMENT ON COLUMN changepoints.form_probability IS 'How probable that form is';
COMMENT ON COLUMN changepoints.slope_percent_per_100h IS 'Change of the resistance in percent per 100 h of dose in its last branch; positive is worse';
COMMENT ON COLUMN changepoints.slope_low IS 'Lower end of 95 % of that';
COMMENT ON COLUMN changepoints.slope_high IS 'Upper end of 95 % of that';
COMMENT ON COLUMN changepoints.significant IS 'True where repeatability alone does not explain what was seen';
COMMENT ON COLUMN changepoints.assessment IS 'Id of the assessment that says so: the latest one';
