-- Hours above 180 degC of a specimen before each of its checks, of which a session may hold several: at `t_ns`, null for
-- the one that its session begins with. A log that goes on while the specimen is out for a check counts up to it.
CREATE VIEW base.doses AS
WITH checks AS (
    SELECT c.session, k.t_ns, c.specimen, c.start, coalesce(k.t_ns, c.start_ns) AS at_ns
    FROM main.sessions AS c
    JOIN (
        SELECT session, t_ns FROM base.measured_checks WHERE dose_h IS NULL
        UNION
        SELECT session, t_ns FROM base.electrical_checks
        UNION
        SELECT session, NULL FROM main.sessions WHERE kind = 'insulation_check'
    ) AS k ON k.session = c.session
),
before AS (
    SELECT
        c.session, c.t_ns,
        coalesce(sum(
            CASE
                WHEN e.start_ns + 1e9 * e.duration_s <= c.at_ns THEN h.hours_above_180degC
                ELSE list_sum([greatest(0, least(a.to_ns, c.at_ns) - a.from_ns) FOR a IN h.above]) / 3.6e12
            END
        ) FILTER (WHERE e.start IS NOT NULL AND e.session <> c.session AND e.start_ns < c.at_ns), 0) AS dose,
        bool_or(e.kind = 'ageing' AND (e.start IS NULL OR (e.start_ns < c.at_ns AND h.session IS NULL))) AS unknown
    FROM checks AS c
    JOIN main.sessions AS e ON e.specimen = c.specimen
    LEFT JOIN base.hours AS h ON h.session = e.session
    WHERE c.start IS NOT NULL
    GROUP BY c.session, c.t_ns
)
SELECT
    c.session, c.t_ns,
    CASE WHEN NOT unknown THEN round(dose, 6) END AS dose_h,
    CASE
        WHEN c.specimen IS NULL THEN 'no specimen is named'
        WHEN c.start IS NULL THEN 'no absolute time'
        WHEN unknown THEN 'an oven session of the specimen has no hours or no absolute time'
    END AS why
FROM checks AS c
LEFT JOIN before AS d ON d.session = c.session AND d.t_ns IS NOT DISTINCT FROM c.t_ns;

CREATE VIEW dc_checks AS
SELECT
    s.session,
    s.name,
    s.specimen,
    s.batch,
    if(s.start IS NULL OR m.record IS NULL, s.start, make_timestamp_ns(m.t_ns)::TIMESTAMP) AS start,
    coalesce(m.dose_h, d.dose_h) AS dose_h,
    m.resistance_K_per_W,
    m.copper_degC,
    m.iron_degC,
    m.power_W,
    m.drift_percent,
    m.load_s,
    m.why_no_resistance,
    CASE WHEN m.dose_h IS NULL THEN d.why END AS why_no_dose,
    m.power_from,
    m.copper_from,
    m.iron_from,
    m.record
FROM sessions AS s
JOIN base.measured_checks AS m ON m.session = s.session
LEFT JOIN base.doses AS d ON d.session = s.session AND d.t_ns IS NOT DISTINCT FROM m.t_ns
ORDER BY s.specimen, start, dose_h, s.name, m.record;

COMMENT ON VIEW dc_checks IS
    'One row a DC check: the thermal resistance of the stator''s insulation; of a table of checks that were evaluated elsewhere, one row each of its rows. Steady: at least 20 min of load without a break, and the resistance over the last 10 min within 1 % of that over the 10 min before. Copper and iron channels are those of these regions (see `channels`); held or stuck samples are not left out. One value holds enamel, resin, liner and the sensors'' places together: compare it with other checks of the same specimen and channels only.';
COMMENT ON COLUMN dc_checks.session IS 'Id of the session';
COMMENT ON COLUMN dc_checks.name IS 'Name of the session';
COMMENT ON COLUMN dc_checks.specimen IS 'Which motor or stator was checked';
COMMENT ON COLUMN dc_checks.batch IS 'The batch that the specimen belongs to';
COMMENT ON COLUMN dc_checks.start IS 'Time of the first record, UTC; null without absolute time';
COMMENT ON COLUMN dc_checks.dose_h IS
    'Hours of the hottest copper channel above 180 degC, summed over the specimen''s earlier sessions, whatever their kind, up to the check; where a table gives the dose, that';
COMMENT ON COLUMN dc_checks.resistance_K_per_W IS '(copper_degC - iron_degC) / power_W in K/W, or as a table gives it; null where it is not steady or something is missing';
COMMENT ON COLUMN dc_checks.copper_degC IS 'Mean of the copper channels over the last 10 min of load';
COMMENT ON COLUMN dc_checks.iron_degC IS 'Mean of the iron channels over the last 10 min of load';
COMMENT ON COLUMN dc_checks.power_W IS 'Mean electrical power over the last 10 min of load: V I';
COMMENT ON COLUMN dc_checks.drift_percent IS 'Change of the resistance from the 10 min before to the last 10 min of load';
COMMENT ON COLUMN dc_checks.load_s IS 'How long the load was on without a break before it ended; on: above half of its 99.5 % quantile';
COMMENT ON COLUMN dc_checks.why_no_resistance IS 'Why the resistance is null';
COMMENT ON COLUMN dc_checks.why_no_dose IS 'Why the dose is null';
COMMENT ON COLUMN dc_checks.power_from IS
    'power (a channel of it), else voltage x current, of several channels the largest; `given in a table` where the resistance is';
COMMENT ON COLUMN dc_checks.copper_from IS 'The copper channels';
COMMENT ON COLUMN dc_checks.iron_from IS 'The iron channels';
COMMENT ON COLUMN dc_checks.record IS 'Row of the table that gives it, from 0; null for a log';
