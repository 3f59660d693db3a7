CREATE VIEW temperatures AS
SELECT
    a.run, r.session, r.session_name, v.node, v.t_ns, (v.t_ns - s.start_ns) / 1e9 AS t_s, v.temperature_degC, r.is_current
FROM base.temperatures AS v
JOIN base.artefacts AS a ON a.file = v.file
JOIN runs AS r ON r.run = a.run
LEFT JOIN base.sessions AS s ON s.session = r.session;

COMMENT ON VIEW temperatures IS 'One row a step of a run and a node: the modelled temperature, of nodes without a sensor too.';
COMMENT ON COLUMN temperatures.run IS 'Id of the run';
COMMENT ON COLUMN temperatures.session IS 'Id of the session';
COMMENT ON COLUMN temperatures.session_name IS 'Name of the session';
COMMENT ON COLUMN temperatures.node IS 'Node of the motor';
COMMENT ON COLUMN temperatures.t_ns IS 'Time of the step in nanoseconds UTC';
COMMENT ON COLUMN temperatures.t_s IS 'Time since the start of the session in seconds';
COMMENT ON COLUMN temperatures.temperature_degC IS 'The modelled temperature';
COMMENT ON COLUMN temperatures.is_current IS 'True for the run that a report shows: the last of its session with the motor file that is current for it, else with any';
