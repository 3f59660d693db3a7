-- What the ledger says, as plain tables that the views read. Filled by analytics/tables.py; every column name is its own
-- word of `ingest.facts.events`, and `place` keeps an order. Not documented for users: the views are.

CREATE SCHEMA base;

CREATE TABLE base.built_from (what VARCHAR, value VARCHAR);

CREATE TABLE base.events (
    position BIGINT, stream VARCHAR, version BIGINT, topic VARCHAR, happened VARCHAR, recorded VARCHAR, code VARCHAR,
    caused_by VARCHAR, digest VARCHAR, payload JSON
);

CREATE TABLE base.files (raw VARCHAR, name VARCHAR, size BIGINT, format VARCHAR, recorded VARCHAR, place BIGINT);

CREATE TABLE base.decodes (
    decode VARCHAR, place BIGINT, raw VARCHAR, bench VARCHAR, decoder VARCHAR, outcome VARCHAR, why VARCHAR,
    absolute BOOLEAN, start_ns BIGINT, end_ns BIGINT,
    found BIGINT, decoded BIGINT, unknown_id BIGINT, wrong_length BIGINT, rejected BIGINT
);

CREATE TABLE base.benches (bench VARCHAR, name VARCHAR);

CREATE TABLE base.sessions (
    session VARCHAR, place BIGINT, name VARCHAR, kind VARCHAR, kind_why VARCHAR, specimen VARCHAR, batch VARCHAR,
    bench VARCHAR, motor VARCHAR, model VARCHAR, configuration VARCHAR, attributes JSON, absolute BOOLEAN,
    start_ns BIGINT, end_ns BIGINT
);

CREATE TABLE base.session_files (session VARCHAR, raw VARCHAR, decode VARCHAR, first_record BIGINT, last_record BIGINT);

-- `file`: the whole path of a Parquet file, spelled as the scan of it spells it.
-- `sha256`: of its bytes, as the event says that names it. `doubled`: some of its stamps come twice.
CREATE TABLE base.groups (decode VARCHAR, group_name VARCHAR, file VARCHAR, sha256 VARCHAR, doubled BOOLEAN);

-- Filled by analytics/doubled.py. `channel`: null where all channels of the record are meant.
CREATE TABLE base.doubled (file VARCHAR, record BIGINT, channel VARCHAR);

CREATE TABLE base.channels (
    decode VARCHAR, place BIGINT, channel VARCHAR, group_name VARCHAR, column_name VARCHAR, quantity VARCHAR,
    unit VARCHAR, node VARCHAR, region VARCHAR, role VARCHAR, derived BOOLEAN
);

-- `session_now`: the current session that the replayed one is, or became part of; `current_model`: whether the motor file
-- is the one that is current for it.
CREATE TABLE base.runs (
    run VARCHAR, place BIGINT, session VARCHAR, session_now VARCHAR, motor VARCHAR, model VARCHAR, level VARCHAR,
    bench VARCHAR, digest VARCHAR, recorded VARCHAR, key JSON, environment JSON, summary JSON, current_model BOOLEAN
);

-- `again`: what brings the file back where it is missing.
CREATE TABLE base.artefacts (run VARCHAR, kind VARCHAR, file VARCHAR, sha256 VARCHAR, again VARCHAR);

-- Filled by analytics/scans.py: files that could not be read and are in no view, `kind` as in `artefacts` or `samples`.
CREATE TABLE base.left_out (file VARCHAR, kind VARCHAR, says VARCHAR, again VARCHAR);

-- Of the latest assessment the artefacts are `ageing_checks`, `ageing_specimens` and `ageing_batches`, and `run` is its id.
CREATE TABLE base.inspections (
    inspection VARCHAR, place BIGINT, sha256 VARCHAR, name VARCHAR, media_type VARCHAR, size BIGINT, specimen VARCHAR,
    happened VARCHAR, session VARCHAR, finding VARCHAR, recorded VARCHAR
);

-- What logs say of insulation, one row a session or check: filled by analytics/partitions.py, for the sessions in `asked` at a
-- time. All that a row holds follows from its own log.
CREATE TABLE base.asked (session VARCHAR);

CREATE TABLE base.hours (
    session VARCHAR, channel VARCHAR, highest_degC DOUBLE, hours_above_180degC DOUBLE, mean_above_degC DOUBLE,
    equivalent_1eV_h DOUBLE, equivalent_10K_h DOUBLE, unknown_h DOUBLE,
    above STRUCT(from_ns BIGINT, to_ns BIGINT)[]  -- between which stamps it was above 180 degC
);

CREATE TABLE base.measured_checks (
    session VARCHAR, record BIGINT, t_ns BIGINT, dose_h DOUBLE, resistance_K_per_W DOUBLE, copper_degC DOUBLE,
    iron_degC DOUBLE, power_W DOUBLE, drift_percent DOUBLE, load_s DOUBLE, why_no_resistance VARCHAR, power_from VARCHAR,
    copper_from VARCHAR, iron_from VARCHAR
);

CREATE TABLE base.electrical_checks (
    session VARCHAR, t_ns BIGINT, insulation_resistance_ohm DOUBLE, polarisation_index DOUBLE, capacitance_F DOUBLE, tan_delta DOUBLE,
    inception_voltage_V DOUBLE, temperature_degC DOUBLE
);
