CREATE VIEW events AS
SELECT
    position,
    stream,
    version,
    topic,
    TRY_CAST(happened AS TIMESTAMP) AS happened,
    TRY_CAST(recorded AS TIMESTAMP) AS recorded,
    code,
    caused_by,
    digest,
    payload
FROM base.events
ORDER BY position;

COMMENT ON VIEW events IS 'The ledger: one row a fact, in order. Nothing in it is ever changed.';
COMMENT ON COLUMN events.position IS 'Its number in the ledger, from 1: what `--as-of` takes';
COMMENT ON COLUMN events.stream IS 'What it is about: `file-...`, `session-...`, `run-...`';
COMMENT ON COLUMN events.version IS 'Its number in the stream, from 1';
COMMENT ON COLUMN events.topic IS 'What happened: whyhot:RawFileSealed, whyhot:ReplayCompleted ...';
COMMENT ON COLUMN events.happened IS 'When it happened, UTC, where that is known';
COMMENT ON COLUMN events.recorded IS 'When it was recorded, UTC';
COMMENT ON COLUMN events.code IS 'The program that recorded it, and its version';
COMMENT ON COLUMN events.caused_by IS 'The event or command that it follows from';
COMMENT ON COLUMN events.digest IS 'SHA-256 over the event and the one before it in its stream';
COMMENT ON COLUMN events.payload IS 'The fact itself, as JSON: `payload->>''name''`';
