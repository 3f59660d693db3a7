CREATE VIEW hours_by_temperature AS
SELECT v.specimen, v.batch, v.session, v.session_name, v.channel, v.degC, v.hours, a.run AS assessment
FROM base.ageing_hours AS v
JOIN base.artefacts AS a ON a.file = v.file;

COMMENT ON VIEW hours_by_temperature IS
    'Hours of each specimen of the latest `whyhot ageing` by the temperature of its hottest place, session by session, in steps of 0.1 K (a vehicle''s counters: 1 K within each bin): equivalent hours under any rule are one sum, without reading a log. Empty before the first assessment.';
COMMENT ON COLUMN hours_by_temperature.specimen IS 'Which motor or stator';
COMMENT ON COLUMN hours_by_temperature.batch IS 'The batch that it belongs to';
COMMENT ON COLUMN hours_by_temperature.session IS 'Id of the session';
COMMENT ON COLUMN hours_by_temperature.session_name IS 'Name of the session';
COMMENT ON COLUMN hours_by_temperature.channel IS 'The channel that shows it; counters: hours that a vehicle counted, its latest readout';
COMMENT ON COLUMN hours_by_temperature.degC IS 'Temperature in degC: the middle of the step';
COMMENT ON COLUMN hours_by_temperature.hours IS 'Hours at it';
COMMENT ON COLUMN hours_by_temperature.assessment IS 'Id of the assessment that says so: the latest one';
