-- From the worst residual to the raw log: its samples, the file, and the record in it
WITH worst AS (
    FROM residuals WHERE used AND is_current ORDER BY abs(residual_K) DESC LIMIT 1
)
SELECT w.node, w.t_s AS step_s, w.residual_K, s.channel, s.t_s, s.value, s.unit, f.name, s.record, s.file_id
FROM worst AS w
JOIN samples AS s
    ON s.file_id = w.file_id AND s.channel = w.channel AND s.record BETWEEN w.first_record AND w.last_record
JOIN files AS f ON f.file_id = s.file_id
ORDER BY s.record;
