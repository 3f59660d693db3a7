CREATE VIEW sessions AS
SELECT
    s.session,
    s.name,
    s.kind,
    s.specimen,
    s.batch,
    CASE WHEN s.absolute THEN make_timestamp_ns(s.start_ns)::TIMESTAMP END AS start,
    (s.end_ns - s.start_ns) / 1e9 AS duration_s,
    coalesce(f.files, 0) AS files,
    coalesce(c.channels, 0) AS channels,
    coalesce(f.quarantined, 0) AS quarantined,
    s.motor,
    b.name AS bench,
    s.kind_why,
    s.configuration,
    s.attributes,
    s.model,
    s.bench AS bench_id,
    s.start_ns
FROM base.sessions AS s
LEFT JOIN base.benches AS b ON b.bench = s.bench
LEFT JOIN (
    SELECT p.session, count(*) AS files, sum(d.wrong_length + d.rejected)::BIGINT AS quarantined
    FROM (SELECT DISTINCT session, decode FROM base.session_files) AS p
    JOIN base.decodes AS d ON d.decode = p.decode
    GROUP BY p.session
) AS f ON f.session = s.session
LEFT JOIN (
    SELECT p.session, count(DISTINCT n.channel) AS channels
    FROM base.session_files AS p
    JOIN base.channels AS n ON n.decode = p.decode
    WHERE n.role IS DISTINCT FROM 'ignored'
    GROUP BY p.session
) AS c ON c.session = s.session
ORDER BY s.place;

COMMENT ON VIEW sessions IS 'One row a test: what was recorded, on what, when. In order of start, then name.';
COMMENT ON COLUMN sessions.session IS 'Id of the session';
COMMENT ON COLUMN sessions.name IS 'Name of its first file, up to the first dot';
COMMENT ON COLUMN sessions.kind IS 'wltp, s1, s2, ageing, dc_check, insulation_check, drive or other';
COMMENT ON COLUMN sessions.kind_why IS 'How the kind is known: said by whom, or recognised by what';
COMMENT ON COLUMN sessions.specimen IS 'Which motor or stator was on the bench';
COMMENT ON COLUMN sessions.batch IS 'The batch that the specimen belongs to';
COMMENT ON COLUMN sessions.motor IS 'Name of the motor that the bench file names';
COMMENT ON COLUMN sessions.model IS 'SHA-256 of the motor file as it lay beside the bench file when the session''s files came';
COMMENT ON COLUMN sessions.bench IS 'File name of the bench file';
COMMENT ON COLUMN sessions.bench_id IS 'SHA-256 of the bench file: its version';
COMMENT ON COLUMN sessions.configuration IS 'Configuration of the motor, where the bench file names one';
COMMENT ON COLUMN sessions.attributes IS 'Facts of the session from the bench file, as JSON';
COMMENT ON COLUMN sessions.start IS 'Time of the first record, UTC; null where the files have no absolute time';
COMMENT ON COLUMN sessions.start_ns IS 'The same in nanoseconds; where `samples.t_s` counts from';
COMMENT ON COLUMN sessions.duration_s IS 'From first to last record in seconds';
COMMENT ON COLUMN sessions.files IS 'Number of files';
COMMENT ON COLUMN sessions.channels IS 'Number of channels, without those that the bench file ignores';
COMMENT ON COLUMN sessions.quarantined IS 'Records of its files that could not be read or decoded';
