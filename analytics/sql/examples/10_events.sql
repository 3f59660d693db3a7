-- The facts of the store by kind
SELECT topic, count(*) AS events, max(recorded) AS latest
FROM events
GROUP BY topic
ORDER BY events DESC, topic;
