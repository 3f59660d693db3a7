-- Which rows of which Parquet file belong to which session, with what `samples` says of each of them: one small table, so
-- that the scan of the files meets a single join and skips the files of other sessions.
CREATE TABLE base.segments AS
SELECT
    s.session, s.name AS session_name, s.start_ns, f.raw AS file_id, g.group_name, g.file, f.first_record, f.last_record
FROM base.session_files AS f
JOIN base.sessions AS s ON s.session = f.session
JOIN base.groups AS g ON g.decode = f.decode;
