CREATE VIEW inspections AS
SELECT
    i.inspection,
    i.specimen,
    s.batch,
    coalesce(TRY_CAST(i.happened AS TIMESTAMP), s.start + to_microseconds((s.duration_s * 1e6)::BIGINT)) AS happened,
    CASE WHEN i.happened IS NOT NULL THEN 'said' WHEN s.start IS NOT NULL THEN 'end of the session' END AS happened_from,
    i.finding,
    i.name,
    i.media_type,
    i.size,
    i.sha256,
    i.session,
    s.name AS session_name,
    TRY_CAST(i.recorded AS TIMESTAMP) AS recorded
FROM base.inspections AS i
LEFT JOIN sessions AS s ON s.session = i.session
ORDER BY i.specimen, happened, i.place;

COMMENT ON VIEW inspections IS
    'One row a photograph, thermogram or other file that `whyhot attach` sealed with a finding. Its bytes lie in the store as archive/<first 2 digits of sha256>/<sha256>.';
COMMENT ON COLUMN inspections.inspection IS 'Id of the inspection: hash of file, specimen, time, session and finding';
COMMENT ON COLUMN inspections.specimen IS 'Which motor or part was inspected';
COMMENT ON COLUMN inspections.batch IS 'The batch that the specimen belongs to, where a session is named';
COMMENT ON COLUMN inspections.happened IS 'When, UTC: as it was said, else the end of the session that it followed; null where neither is known';
COMMENT ON COLUMN inspections.happened_from IS '`said`, or `end of the session`';
COMMENT ON COLUMN inspections.finding IS 'What a person found';
COMMENT ON COLUMN inspections.name IS 'File name';
COMMENT ON COLUMN inspections.media_type IS 'image/jpeg ..., by the end of the name';
COMMENT ON COLUMN inspections.size IS 'Size in bytes';
COMMENT ON COLUMN inspections.sha256 IS 'SHA-256 of the file';
COMMENT ON COLUMN inspections.session IS 'Id of the session that it followed, where one is named';
COMMENT ON COLUMN inspections.session_name IS 'Name of that session';
COMMENT ON COLUMN inspections.recorded IS 'When it was recorded, UTC';
