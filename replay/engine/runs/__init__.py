"""A session replayed, sealed and cited: its key, its digest, and many sessions with one writer of facts."""
