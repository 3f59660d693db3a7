-- What a node is made of, told from its name as `ingest.resolving` tells it without a motor file; null where the name says nothing.
CREATE MACRO base.region(node) AS CASE
    WHEN regexp_matches(node, '^(winding|endwinding|terminal)') THEN 'copper'
    WHEN regexp_matches(node, '^(yoke|teeth|tooth|stator|iron)') THEN 'iron'
    WHEN regexp_matches(node, '^(oven|ambient|coolant)') THEN 'boundary'
END;
