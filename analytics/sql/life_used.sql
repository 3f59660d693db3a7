CREATE VIEW life_used AS
SELECT
    v.specimen,
    v.batch,
    v.checks,
    v.dose_h,
    v.equivalent_low_h,
    v.equivalent_high_h,
    v.life_used_low,
    v.life_used_high,
    v.remaining_low_h,
    v.remaining_high_h,
    a.run AS assessment
FROM base.ageing_specimens AS v
JOIN base.artefacts AS a ON a.file = v.file
ORDER BY v.life_used_high DESC NULLS LAST, v.specimen;

COMMENT ON VIEW life_used IS
    'One row a specimen of the latest `whyhot ageing`: what of its life is used, and what remains. Empty before the first assessment.';
COMMENT ON COLUMN life_used.specimen IS 'Which motor or stator';
COMMENT ON COLUMN life_used.batch IS 'The batch that it belongs to';
COMMENT ON COLUMN life_used.checks IS 'Number of its checks';
COMMENT ON COLUMN life_used.dose_h IS 'Hours above the threshold (180 degC) at its last check';
COMMENT ON COLUMN life_used.equivalent_low_h IS 'The same dose as hours at the threshold, the least over the rules that the assessment states, each end by one rule';
COMMENT ON COLUMN life_used.equivalent_high_h IS 'The most over the rules that the assessment states, each end by one rule';
COMMENT ON COLUMN life_used.life_used_low IS 'Share of the class''s life (20,000 h at 180 degC) that is used, the least over the rules that the assessment states, each end by one rule';
COMMENT ON COLUMN life_used.life_used_high IS 'The most over the rules that the assessment states, each end by one rule';
COMMENT ON COLUMN life_used.remaining_low_h IS 'Dose in hours until the criterion of end of life that the assessment names, lower end of 90 %; null where it is not reached';
COMMENT ON COLUMN life_used.remaining_high_h IS 'Upper end of 90 %; null where it is not reached';
COMMENT ON COLUMN life_used.assessment IS 'Id of the assessment that says so: the latest one';
