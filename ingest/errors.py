"""Errors of the facts layer: one class a condition; the message is one line with what, where, why and what to do."""

WITH_EXTRAS = "uv tool install '.[view,notebooks,tdms,xlsx]'"


class IngestError(Exception):
    """Root of everything that `ingest` refuses. `str(error)` is the whole line that a person reads."""


class BenchFileError(IngestError):
    """A bench file says something that cannot be true of these logs."""


class TomlError(IngestError):
    """A TOML file of ours cannot be read, or holds an unknown key."""


class UnitError(IngestError):
    """A unit text that is not known, or does not fit its quantity."""


class ExpressionError(IngestError):
    """The expression of a derived channel is not one of those allowed, or names an unknown signal."""


class DatabaseError(IngestError):
    """A signal database (DBC, KCD, SYM, ARXML) cannot be read."""


class UnreadableLogError(IngestError):
    """Nothing in a log file can be read: it is quarantined."""


class ChangingFileError(IngestError):
    """A file changed while it was being sealed."""


class LedgerError(IngestError):
    """The ledger refuses: another writer holds it, or an event is not one of ours."""


class OvertakenError(LedgerError):
    """Another writer recorded meanwhile what a new event should have been made of."""


class ServerError(LedgerError):
    """The server that holds the ledger does not answer, or does not let in: of the ledger nothing is known."""


class StoreError(IngestError):
    """The store folder is missing, is not ours, or cannot be written."""


class BucketError(StoreError):
    """The server that holds sealed bytes and samples does not answer, or does not let in: of them nothing is known."""


class DamageError(IngestError):
    """Stored bytes are not what was sealed."""


class UnknownSessionError(IngestError):
    """A session named by id, prefix or name is not in the store, or is not the only one."""


class CorrectionError(IngestError):
    """What is to be corrected or taken back is not there, is so already, or is nothing that can be."""


def not_installed(what: str, command: str = WITH_EXTRAS) -> str:
    """The line for a part of whyhot that is an extra and is not there."""
    return f"{what} is not installed: in a clone of whyhot, {command} (or pipx install --force with the same)"
