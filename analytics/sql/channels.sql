CREATE VIEW channels AS
SELECT DISTINCT
    s.session, s.name AS session_name, c.channel, c.quantity, c.unit, c.node, c.region, c.role, c.derived,
    c.group_name, c.column_name
FROM base.sessions AS s
JOIN base.session_files AS f ON f.session = s.session
JOIN base.channels AS c ON c.decode = f.decode;

COMMENT ON VIEW channels IS 'One row a channel of a session: what `samples` holds of it.';
COMMENT ON COLUMN channels.session IS 'Id of the session';
COMMENT ON COLUMN channels.session_name IS 'Name of the session';
COMMENT ON COLUMN channels.channel IS 'Signal of the log, or derived channel of the bench file';
COMMENT ON COLUMN channels.quantity IS 'temperature, speed, current ... as the bench file says; null without one';
COMMENT ON COLUMN channels.unit IS 'Unit of its values';
COMMENT ON COLUMN channels.node IS 'Node or boundary of the motor that it measures';
COMMENT ON COLUMN channels.region IS
    'copper, iron, magnet, rotor, housing, fluid, bearing, boundary or other: as the motor file says of the node, without one as the bench file says, else by the node''s name; null where none of them tells';
COMMENT ON COLUMN channels.role IS 'observed, input or ignored; null for a signal that no bench file names';
COMMENT ON COLUMN channels.derived IS 'True where it is computed from other signals';
COMMENT ON COLUMN channels.group_name IS 'Message of the bus that carries it, or `rows` of a table';
COMMENT ON COLUMN channels.column_name IS 'Its column in the Parquet file of the group';
