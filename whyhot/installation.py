"""Whether what is installed is whyhot's: another distribution with packages of these names may overwrite it."""

from __future__ import annotations

import base64
import csv
import hashlib
from importlib.metadata import Distribution, PackageNotFoundError, distribution, packages_distributions
from importlib.util import find_spec
from pathlib import Path

from whyhot import PACKAGES

ADVICE = "install whyhot again, as an application of its own (uv tool install or pipx)"


def problems() -> list[str]:
    """One line for each thing that is wrong with the installation, with what to do; none where all is well.

    They are: packages of ours that are not there; other distributions that install one too; files of ours that are
    missing or not as they were installed, by the SHA-256 in the distribution's RECORD.
    """
    missing = [f"package {name} of whyhot is missing: {ADVICE}." for name in PACKAGES if find_spec(name) is None]
    return [*missing, *_other_distributions(), *_changed_files()]


def _other_distributions() -> list[str]:
    owners = packages_distributions()
    others = {(name, other) for name in PACKAGES for other in owners.get(name, ()) if other != "whyhot"}
    return [
        f"{other} installs a package {name} too, and one of the two overwrites or hides the other: {ADVICE}."
        for name, other in sorted(others)
    ]


def _changed_files() -> list[str]:
    try:
        ours = distribution("whyhot")
    except PackageNotFoundError:  # a checkout that is not installed
        return []
    rows = csv.reader((ours.read_text("RECORD") or "").splitlines())  # `ours.files` leaves out what is missing
    changed = [
        path for path, sha, *_ in rows if path.split("/")[0] in PACKAGES and not _is_as_installed(ours, path, sha)
    ]
    if not changed:
        return []
    others = f" and {len(changed) - 1} more" if len(changed) > 1 else ""
    return [f"{changed[0]}{others} of whyhot: missing, or not as installed: {ADVICE}."]


def _is_as_installed(ours: Distribution, path: str, sha: str) -> bool:
    if not sha:  # compiled by Python afterwards
        return True
    try:
        data = Path(str(ours.locate_file(path))).read_bytes()
    except OSError:
        return False
    return sha == "sha256=" + base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()
