-- Findings on the time line: what inspections showed, after how many hours in the oven
SELECT i.specimen, i.happened, i.finding, i.name, sum(c.hours_above_180degC) AS above_180degC_h
FROM inspections AS i
LEFT JOIN cycles AS c ON c.specimen = i.specimen AND c."end" <= i.happened
GROUP BY ALL
ORDER BY i.specimen, i.happened;
