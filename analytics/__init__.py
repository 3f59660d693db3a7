"""SQL over the store: the DuckDB warehouse, confined queries, and what is made again from the ledger."""
