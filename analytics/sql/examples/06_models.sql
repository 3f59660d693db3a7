-- Two models compared: the error at the magnet in every run
SELECT session_name, left(model, 8) AS model, mae_K, (summary->'mae_K'->>'magnet')::DOUBLE AS magnet_mae_K
FROM runs
ORDER BY session_name, recorded;
