-- Sessions in which ageing was named as a cause
SELECT s.name, n.payload->>'cause' AS cause, (n.payload->>'probability')::DOUBLE AS probability
FROM events AS n
JOIN events AS d ON d.stream = n.stream AND d.topic = 'whyhot:DiagnosisCompleted'
JOIN sessions AS s ON list_contains(from_json(d.payload->'key'->'train', '["VARCHAR"]'), s.session)
WHERE n.topic = 'whyhot:CauseNamed' AND n.payload->>'cause' LIKE 'ageing.%';
