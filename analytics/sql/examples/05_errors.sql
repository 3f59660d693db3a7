-- Where the twin is wrong: error of each node by speed
SELECT
    node,
    floor(speed_rpm / 4000) * 4000 AS from_rpm,
    avg(residual_K) AS bias_K,
    avg(abs(residual_K)) AS mae_K,
    count(*) AS steps
FROM residuals
WHERE used AND is_current
GROUP BY ALL
ORDER BY mae_K DESC;
