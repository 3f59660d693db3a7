CREATE VIEW files AS
WITH in_sessions AS (SELECT DISTINCT raw, decode FROM base.session_files),
current_decode AS (  -- the one that the sessions use, else the latest
    SELECT d.*
    FROM base.decodes AS d
    LEFT JOIN in_sessions AS s ON s.decode = d.decode
    QUALIFY row_number() OVER (PARTITION BY d.raw ORDER BY s.decode IS NULL, d.place DESC) = 1
)
SELECT
    f.name,
    d.outcome,
    d.found,
    d.decoded,
    d.unknown_id,
    d.wrong_length,
    d.rejected,
    d.why,
    f.format,
    f.size AS size_bytes,
    CASE WHEN d.absolute THEN make_timestamp_ns(d.start_ns)::TIMESTAMP END AS start,
    (d.end_ns - d.start_ns) / 1e9 AS duration_s,
    TRY_CAST(f.recorded AS TIMESTAMP) AS sealed,
    b.name AS bench,
    d.decoder,
    d.decode,
    f.raw AS file_id
FROM base.files AS f
LEFT JOIN current_decode AS d ON d.raw = f.raw
LEFT JOIN base.benches AS b ON b.bench = d.bench
ORDER BY f.place;

COMMENT ON VIEW files IS
    'One row a raw log, with what became of each of its records: found = decoded + unknown_id + wrong_length + rejected.';
COMMENT ON COLUMN files.file_id IS 'SHA-256 of its bytes: its name in the archive';
COMMENT ON COLUMN files.name IS 'Its name when it was ingested';
COMMENT ON COLUMN files.size_bytes IS 'Its size in bytes';
COMMENT ON COLUMN files.format IS 'log format; null where no format claims it';
COMMENT ON COLUMN files.sealed IS 'When it came into the archive, UTC';
COMMENT ON COLUMN files.decode IS 'Id of the decode that its sessions use, else of the latest: a folder of decoded/';
COMMENT ON COLUMN files.outcome IS 'decoded, salvaged (up to some damage) or quarantined (nothing can be read)';
COMMENT ON COLUMN files.why IS 'Where it was not decoded whole: the line that was printed';
COMMENT ON COLUMN files.decoder IS 'Version of the decoder';
COMMENT ON COLUMN files.bench IS 'Name of the bench file that it was decoded under';
COMMENT ON COLUMN files.start IS 'Time of the first record, UTC; null without absolute time';
COMMENT ON COLUMN files.duration_s IS 'From first to last record in seconds';
COMMENT ON COLUMN files.found IS 'Records in the file (frames or rows)';
COMMENT ON COLUMN files.decoded IS 'Records that became samples';
COMMENT ON COLUMN files.unknown_id IS 'Frames with an identifier that is in no database';
COMMENT ON COLUMN files.wrong_length IS 'Frames shorter than their message; longer ones are decoded';
COMMENT ON COLUMN files.rejected IS 'Records that could not be read';
