-- What 300 h at 230 degC are worth at 180 degC, by each rule alone
SELECT
    equivalent_hours(230, 300, 180, 0.9) AS at_0_9_eV,
    equivalent_hours(230, 300, 180, 1.1) AS at_1_1_eV,
    equivalent_hours_10K(230, 300, 180) AS by_10_K;
