-- Hours of each temperature of a session above 182 degC, and what they are worth at 180 degC
FROM equivalent_hours_of('oven_a', 182, 180, 1.0);
