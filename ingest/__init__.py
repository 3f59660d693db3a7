"""Logs become facts: readers, recordings, decoded samples, the ledger, sessions and the catalogue."""
