"""The verb: files at a door become facts, sessions and inspections, or are only looked into."""
