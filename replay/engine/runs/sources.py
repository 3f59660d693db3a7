"""What a computation's answer depends on in our own code: its source file and all that it imports, however far down.

Keys hash this, so an answer is computed anew where code that made it changed, and read back where other code did. The
list is made from the import lines themselves. Log formats are found by name at run time and are not in it: what they
gave is in a key by the hashes of decoded samples and input frame.
"""

from __future__ import annotations

import hashlib
import re
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[3]  # the folder that holds our packages
_PACKAGES = "(?:twin|ingest|analytics|replay)"
_FROM = re.compile(rf"^ *from ({_PACKAGES}[\w.]*) import (?:\(([^)]*)\)|([^\n(]*))", re.MULTILINE)
_IMPORT = re.compile(rf"^ *import ({_PACKAGES}[\w.]*)", re.MULTILINE)


@cache
def code_of(door: str) -> str:
    """SHA-256 over names and bytes of a module such as "replay.engine.runs.runs" and of all of ours that it imports."""
    sha = hashlib.sha256()
    for module in sorted(closure(door)):
        sha.update(module.encode() + b"\0" + _file(module).read_bytes() + b"\0")
    return sha.hexdigest()


def closure(door: str) -> set[str]:
    """The module itself and all of ours that it imports, directly or through others, for the sake of a type too."""
    found: set[str] = set()
    left = [door]
    while left:
        module = left.pop()
        if module not in found:
            found.add(module)
            left += imported(module)
    return found


def imported(module: str) -> set[str]:
    """Our modules that a module's own text imports, at its top or inside functions."""
    text = _file(module).read_text(encoding="utf-8")
    found = set(_IMPORT.findall(text))
    for package, many, few in _FROM.findall(text):
        names = re.sub(r"#.*| as \w+", "", many or few).replace(",", " ").split()
        found |= {one if _file(one := f"{package}.{name}").is_file() else package for name in names}
    return {name for name in found if _file(name).is_file()}  # a verb may do without a part that is not installed


def _file(module: str) -> Path:
    path = ROOT.joinpath(*module.split("."))
    return path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
