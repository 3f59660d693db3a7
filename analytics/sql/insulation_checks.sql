CREATE VIEW insulation_checks AS
SELECT
    s.session,
    s.name,
    s.specimen,
    s.batch,
    if(f.t_ns IS NULL, s.start, make_timestamp_ns(f.t_ns)::TIMESTAMP) AS start,
    d.dose_h,
    f.insulation_resistance_ohm,
    f.polarisation_index,
    f.capacitance_F,
    f.tan_delta,
    f.inception_voltage_V,
    f.temperature_degC,
    d.why AS why_no_dose
FROM sessions AS s
LEFT JOIN base.electrical_checks AS f ON f.session = s.session
JOIN base.doses AS d ON d.session = s.session AND d.t_ns IS NOT DISTINCT FROM f.t_ns
WHERE s.kind = 'insulation_check'
ORDER BY s.specimen, start, s.name;

COMMENT ON VIEW insulation_checks IS
    'One row an electrical check of the insulation (kind `insulation_check`); values of a session that are an hour apart, as rows of a table of checks, are several. Of several channels of a quantity (phases) the worst counts: lowest resistance, index and inception voltage, highest tan delta; of capacitances the median. Null where it was not measured.';
COMMENT ON COLUMN insulation_checks.session IS 'Id of the session';
COMMENT ON COLUMN insulation_checks.name IS 'Name of the session';
COMMENT ON COLUMN insulation_checks.specimen IS 'Which motor or stator was checked';
COMMENT ON COLUMN insulation_checks.batch IS 'The batch that the specimen belongs to';
COMMENT ON COLUMN insulation_checks.start IS 'When it began, UTC; null without absolute time';
COMMENT ON COLUMN insulation_checks.dose_h IS 'Hours above 180 degC before it, as in `dc_checks`';
COMMENT ON COLUMN insulation_checks.insulation_resistance_ohm IS 'Insulation resistance in ohm, the last value: it rises while the test voltage charges the insulation. It falls with temperature, about to half for 10 K: compare at like `temperature_degC`';
COMMENT ON COLUMN insulation_checks.polarisation_index IS 'Polarisation index, insulation resistance after 10 min over that after 1 min, as recorded, the last value; it is not computed here, as the log does not say when the voltage came on';
COMMENT ON COLUMN insulation_checks.capacitance_F IS 'Capacitance in farad, median';
COMMENT ON COLUMN insulation_checks.tan_delta IS 'Dissipation factor (1 = 100 %), median';
COMMENT ON COLUMN insulation_checks.inception_voltage_V IS 'Inception voltage of partial discharge in volt, median over the sweeps';
COMMENT ON COLUMN insulation_checks.temperature_degC IS 'Median of its temperature channels in degC';
COMMENT ON COLUMN insulation_checks.why_no_dose IS 'Why the dose is null';
