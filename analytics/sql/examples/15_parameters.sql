-- Parameters of each motor as of a date: those of its latest calibration up to then
SELECT motor, p->>'name' AS parameter, (p->>'value')::DOUBLE AS value, value * (p->>'sd')::DOUBLE AS sd, p->>'unit' AS unit
FROM (
    SELECT payload->>'motor' AS motor, unnest(from_json(payload->'parameters', '["JSON"]')) AS p
    FROM events
    WHERE topic = 'whyhot:CalibrationCompleted' AND recorded < '2050-01-01'
    QUALIFY row_number() OVER (PARTITION BY payload->>'motor' ORDER BY position DESC) = 1
);
