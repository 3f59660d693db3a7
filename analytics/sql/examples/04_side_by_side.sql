-- Channels side by side, second by second
PIVOT (SELECT floor(t_s) AS second, channel, value FROM samples WHERE session_name = '1_s1')
ON channel IN ('speed', 'MAG_1')
USING avg(value)
GROUP BY second
ORDER BY second;
