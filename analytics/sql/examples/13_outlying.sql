-- Specimens that stand out from their fleet, and the batches that do
SELECT specimen, batch, slope_percent_per_100h, score FROM fleet_health WHERE outlying
UNION ALL BY NAME
SELECT batch, slope_percent_per_100h, score FROM batches WHERE outlying;
