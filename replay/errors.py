"""Errors of the shell: one class a condition; the message is one line with what, where, why and what to do."""


class ReplayError(Exception):
    """Root of everything that `replay` refuses. `str(error)` is the whole line that a person reads."""


class MotorFileError(ReplayError):
    """A motor file says something that cannot be true; the line names the entry."""


class ReplayDataError(ReplayError):
    """A session does not hold what a replay with this motor needs."""


class ClusterError(ReplayError):
    """A cluster of workers is not there, went away, or has another version than this one."""


class PlanFileError(ReplayError):
    """A file that is no plan, or one that a diagnosis cannot be held against."""


class ViewerError(ReplayError):
    """The rerun viewer or SDK is not installed, or did not start."""


class NotebookError(ReplayError):
    """A notebook that is not there, that cannot be written as asked, or that marimo does not open."""


class ExportError(ReplayError):
    """A session or file that cannot be written out as asked, or would go over a file that is there."""
