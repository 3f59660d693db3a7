"""Errors of the SQL side: one class a condition; the message is one line with what, where, why and what to do."""


class AnalyticsError(Exception):
    """Root of everything that `analytics` refuses. `str(error)` is the whole line that a person reads."""


class WarehouseError(AnalyticsError):
    """The warehouse cannot be built or opened: the folder is read-only, or a file is missing that its asker needs."""


class QueryError(AnalyticsError):
    """A query that DuckDB cannot answer: an unknown name, wrong syntax, an unfit value, too little memory."""


class LostFileError(QueryError):
    """A query that reads a file which was there when the warehouse was made, and is not now: one made anew answers."""


class RefusedQueryError(AnalyticsError):
    """A query that would do more than read the views of this store."""


class WorkerLostError(AnalyticsError):
    """The process that weighed the courses of some specimens ended each time."""
