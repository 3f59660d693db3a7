CREATE MACRO equivalent_hours_10K(temperature_degC, hours, at_degC) AS hours * pow(2, (temperature_degC - at_degC) / 10);

COMMENT ON MACRO equivalent_hours_10K IS
    'Hours at `at_degC` that `hours` at `temperature_degC` are worth by the rule that life halves every 10 K: hours 2^((T - at) / 10). 300 h at 230 degC are 9,600 h at 180 degC. Near 180 degC the rule is worth about 1.2 eV, and more at higher temperatures.';
