-- The insulation's resistance over the dose, as the latest assessment has it
SELECT
    specimen, dose_h, equivalent_low_h, equivalent_high_h, resistance_K_per_W, conductivity_percent, source
FROM conductivity_by_cycle
ORDER BY specimen, dose_h;
