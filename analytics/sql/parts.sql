-- Which sessions have rows of which table (`holds`), in which partition, and on what these rows depend: hours of every oven
-- session and of every session of a specimen that was checked, because a hot drive ages the insulation too. Motors are put
-- into 16 groups by the SHA-256 of their names: a fleet of any size has few files, and a session its place for good.
CREATE TABLE base.parts AS
WITH described AS (
    SELECT decode, md5(string_agg(c::VARCHAR, ' ' ORDER BY c.place)) AS channels
    FROM base.channels AS c
    GROUP BY decode
),
logs AS (  -- of a log that was forgotten there is no group
    SELECT
        f.session, sum(f.last_record - f.first_record + 1)::BIGINT AS records,
        -- as a hash: a motor's rows stand in a fleet's table in as many places as there are
        md5(string_agg(concat_ws(' ', f.decode, f.first_record, f.last_record, g.groups, d.channels), ', '
            ORDER BY f.decode, f.first_record)) AS logs
    FROM base.session_files AS f
    LEFT JOIN described AS d ON d.decode = f.decode
    LEFT JOIN (SELECT decode, count(*) AS groups FROM base.groups GROUP BY decode) AS g ON g.decode = f.decode
    GROUP BY f.session
),
told AS (
    SELECT s.*, l.logs, l.records
    FROM base.sessions AS s
    LEFT JOIN logs AS l ON l.session = s.session
    WHERE s.kind = 'ageing' OR s.specimen IN (
        SELECT o.specimen FROM base.sessions AS o WHERE o.kind IN ('dc_check', 'insulation_check')
    ) OR s.kind IN ('dc_check', 'insulation_check')
)
SELECT
    unnest(CASE kind
        WHEN 'dc_check' THEN ['hours', 'measured_checks']
        WHEN 'insulation_check' THEN ['hours', 'electrical_checks']
        ELSE ['hours']
    END) AS holds,
    left(sha256(coalesce(specimen, '')), 1) AS motors,
    CASE WHEN absolute THEN strftime(make_timestamp_ns(start_ns), '%Y-%m') ELSE 'undated' END AS month,
    session,
    coalesce(records, 0) AS records,
    (session, name, kind, specimen, batch, absolute, start_ns, logs)::VARCHAR AS depends_on
FROM told;
