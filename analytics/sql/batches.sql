CREATE VIEW batches AS
SELECT
    v.batch,
    v.specimens,
    v.slope_percent_per_100h,
    v.score,
    v.outlying,
    a.run AS assessment
FROM base.ageing_batches AS v
JOIN base.artefacts AS a ON a.file = v.file
ORDER BY v.score DESC NULLS LAST, v.batch;

COMMENT ON VIEW batches IS
    'One row a batch of the latest `whyhot ageing`, those that age fastest beyond the others first. Empty before the first assessment.';
COMMENT ON COLUMN batches.batch IS 'Name of the batch';
COMMENT ON COLUMN batches.specimens IS 'Number of its specimens';
COMMENT ON COLUMN batches.slope_percent_per_100h IS 'Mean change of their resistance in percent per 100 h of dose; positive is worse';
COMMENT ON COLUMN batches.score IS 'How far that is from the other batches, in standard deviations';
COMMENT ON COLUMN batches.outlying IS 'True where it stands out, by the false discovery rate that the assessment states';
COMMENT ON COLUMN batches.assessment IS 'Id of the assessment that says so: the latest one';
