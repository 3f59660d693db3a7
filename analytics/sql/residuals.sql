CREATE VIEW residuals AS
SELECT
    a.run,
    r.session,
    r.session_name,
    v.channel,
    v.node,
    v.t_s,
    v.measured_degC,
    v.modelled_degC,
    v.residual_K,
    v.sd_K,
    v.used,
    v.speed_rpm,
    v.torque_Nm,
    v.current_A,
    v.t_ns,
    v.file_id,
    v.first_record,
    v.last_record,
    r.is_current
FROM base.residuals AS v
JOIN base.artefacts AS a ON a.file = v.file
JOIN runs AS r ON r.run = a.run;

COMMENT ON VIEW residuals IS 'One row a step of a run and an observed channel: what was measured, and what the twin said. Runs of several models stand beside each other.';
COMMENT ON COLUMN residuals.run IS 'Id of the run';
COMMENT ON COLUMN residuals.session IS 'Id of the session';
COMMENT ON COLUMN residuals.session_name IS 'Name of the session';
COMMENT ON COLUMN residuals.channel IS 'The observed channel';
COMMENT ON COLUMN residuals.node IS 'The node that it measures, or a weighted mean of nodes';
COMMENT ON COLUMN residuals.t_ns IS 'Mean time of the samples in the step, nanoseconds UTC';
COMMENT ON COLUMN residuals.t_s IS 'Time since the start of the session in seconds';
COMMENT ON COLUMN residuals.measured_degC IS 'Mean of the samples in the step';
COMMENT ON COLUMN residuals.modelled_degC IS 'The twin at the same time';
COMMENT ON COLUMN residuals.residual_K IS 'measured minus modelled';
COMMENT ON COLUMN residuals.sd_K IS 'Uncertainty of the measured mean, bias of the sensor included (one standard deviation)';
COMMENT ON COLUMN residuals.used IS 'False where the samples are held, stuck or saturated, or an input is missing';
COMMENT ON COLUMN residuals.file_id IS 'SHA-256 of the raw log that the samples come from';
COMMENT ON COLUMN residuals.first_record IS 'First record of the step in that log';
COMMENT ON COLUMN residuals.last_record IS 'Last record of the step in that log';
COMMENT ON COLUMN residuals.speed_rpm IS 'Mean speed in the step';
COMMENT ON COLUMN residuals.torque_Nm IS 'Mean torque in the step';
COMMENT ON COLUMN residuals.current_A IS 'Mean phase current in the step, rms';
COMMENT ON COLUMN residuals.is_current IS 'True for the run that a report shows: the last of its session with the motor file that is current for it, else with any';
