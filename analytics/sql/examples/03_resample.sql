-- One channel in steps of 5 s
FROM resample('1_s1', 'MAG_1', 5);
