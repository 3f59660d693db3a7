CREATE VIEW samples AS
SELECT
    session,
    session_name,
    channel,
    quantity,
    node,
    region,
    unit,
    t_ns,
    (t_ns - start_ns) / 1e9 AS t_s,
    value,
    file_id,
    record,
    group_name,
    doubled
FROM (
    SELECT v.* EXCLUDE (file), s.*
    FROM base.values AS v
    JOIN base.segments AS s ON s.file = v.file
    -- as an expression: DuckDB would make a range join of BETWEEN, which takes as long as all the rest
    WHERE CASE WHEN v.record >= s.first_record THEN v.record <= s.last_record ELSE false END
    UNION ALL
    -- the table of a fleet: each row against each of its sessions would be the square of the fleet
    SELECT v.* EXCLUDE (file), s.*
    FROM base.values_of_many AS v
    ASOF JOIN base.segments AS s ON s.file = v.file AND v.record >= s.first_record
    WHERE v.record <= s.last_record
)
WHERE isfinite(value);  -- not `isnan`: DuckDB decides that by the statistics of the file, which know nothing of NaN

COMMENT ON VIEW samples IS
    'One row a measured or derived value, at its native rate. Name a session and a channel where you can: only their files and columns are then read. A value that is absent or not finite has no row; text columns have none either.';
COMMENT ON COLUMN samples.session IS 'Id of the session';
COMMENT ON COLUMN samples.session_name IS 'Name of the session';
COMMENT ON COLUMN samples.channel IS 'Signal of the log, or derived channel of the bench file';
COMMENT ON COLUMN samples.quantity IS 'temperature, speed, current ... as the bench file says; null without one';
COMMENT ON COLUMN samples.node IS 'Node or boundary of the motor that it measures';
COMMENT ON COLUMN samples.region IS 'copper, iron, magnet ...: as in `channels`';
COMMENT ON COLUMN samples.unit IS 'Unit of the value: the stored unit of its quantity, else the file''s own';
COMMENT ON COLUMN samples.t_ns IS 'Time in nanoseconds UTC; from 0 where the file has no absolute time';
COMMENT ON COLUMN samples.t_s IS 'Time since the start of the session in seconds';
COMMENT ON COLUMN samples.value IS 'The value in `unit`';
COMMENT ON COLUMN samples.file_id IS 'SHA-256 of the raw log: the key into `files`';
COMMENT ON COLUMN samples.record IS 'Position of the record (frame or row) in the raw log, from 0';
COMMENT ON COLUMN samples.group_name IS 'Message of the bus that carried it, or `rows` of a table';
COMMENT ON COLUMN samples.doubled IS 'True where a record before it in its file and session has a value of the channel at the same stamp, or another log of the session holds the channel meanwhile and counts: `WHERE NOT doubled` leaves one value a session, channel and time';
