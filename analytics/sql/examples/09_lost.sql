-- What could not be read or decoded
SELECT name, outcome, found, decoded, unknown_id, wrong_length, rejected, why
FROM files
WHERE found IS DISTINCT FROM decoded OR outcome <> 'decoded';
