"""Events in a hash-chained ledger, sealed bytes under their SHA-256, and what both say is true now."""
