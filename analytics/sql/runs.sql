CREATE VIEW runs AS
SELECT
    r.run,
    coalesce(r.session_now, r.session) AS session,
    s.name AS session_name,
    s.kind,
    s.specimen,
    r.motor,
    (SELECT avg(e.value::DOUBLE) FROM json_each(r.summary, '$.mae_K') AS e) AS mae_K,
    (SELECT max(abs(e.value::DOUBLE)) FROM json_each(r.summary, '$.max_K') AS e) AS max_K,
    (SELECT arg_max(e.key, e.value::DOUBLE) FROM json_each(r.summary, '$.mae_K') AS e) AS worst_node,
    r.level,
    TRY_CAST(r.recorded AS TIMESTAMP) AS recorded,
    r.model,
    r.bench AS bench_id,
    r.digest,
    r.key,
    r.environment,
    r.summary,
    row_number() OVER (
        PARTITION BY coalesce(r.session_now, r.session) ORDER BY r.current_model DESC, r.place DESC
    ) = 1 AS is_current
FROM base.runs AS r
LEFT JOIN base.sessions AS s ON s.session = r.session_now
ORDER BY r.place;

COMMENT ON VIEW runs IS 'One row a replay: one session with one model. Errors are measured minus modelled.';
COMMENT ON COLUMN runs.run IS 'Id of the run: hash of its key';
COMMENT ON COLUMN runs.session IS 'Id of the session; where it was regrouped, the one that it is now part of';
COMMENT ON COLUMN runs.session_name IS 'Name of the session';
COMMENT ON COLUMN runs.kind IS 'Kind of the session';
COMMENT ON COLUMN runs.specimen IS 'Specimen of the session';
COMMENT ON COLUMN runs.motor IS 'Name of the motor';
COMMENT ON COLUMN runs.model IS 'SHA-256 of the motor file: the version of the model';
COMMENT ON COLUMN runs.level IS 'testing (all channels) or production';
COMMENT ON COLUMN runs.bench_id IS 'SHA-256 of the bench file';
COMMENT ON COLUMN runs.recorded IS 'When the run was recorded, UTC';
COMMENT ON COLUMN runs.mae_K IS 'Mean absolute error in kelvin, averaged over the nodes';
COMMENT ON COLUMN runs.max_K IS 'Largest absolute error at any node in kelvin';
COMMENT ON COLUMN runs.worst_node IS 'Node with the largest mean absolute error';
COMMENT ON COLUMN runs.digest IS 'SHA-256 of its numbers';
COMMENT ON COLUMN runs.key IS 'Everything that the run depends on, as JSON';
COMMENT ON COLUMN runs.environment IS 'Versions and processor it was made with, as JSON';
COMMENT ON COLUMN runs.summary IS 'The answer of `whyhot replay --json` for this run: `summary->''mae_K''->>''magnet''`';
COMMENT ON COLUMN runs.is_current IS 'True for the run that a report shows: the last of its session with the motor file that is current for it, else with any';
