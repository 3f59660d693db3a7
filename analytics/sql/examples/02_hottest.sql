-- How hot it got: every temperature of a session
SELECT channel, node, max(value) AS hottest_degC, arg_max(t_s, value) AS at_s
FROM samples
WHERE session_name = '1_s1' AND quantity = 'temperature'
GROUP BY channel, node
ORDER BY hottest_degC DESC;
