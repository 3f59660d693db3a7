"""Files of signal databases, told by what they hold: DBC, KCD, SYM 6.0 and ARXML. cantools reads them.

What is not read as strictly as cantools would have it is noted; a refusal is one line with file and line.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple
from xml.etree.ElementTree import ParseError

from ingest.errors import DatabaseError
from ingest.texts.encodings import encoding_of

DBC, KCD, SYM, ARXML = "DBC", "KCD", "SYM", "ARXML"
LOOKS: Mapping[str, str] = {  # kind -> what is found in such a file, up to LOOKED characters
    KCD: r"<[\w:-]*NetworkDefinition\b",
    ARXML: r"<[\w:-]*AUTOSAR",
    SYM: r"(?m)^\s*FormatVersion\s*=",
}
DBC_LOOKS = r'(?m)\A\s*VERSION\s+"|^\s*(NS_\s*:|BU_\s*:|BO_\s+\d+\s)'
DECLARES = r"<!DOCTYPE|<!ENTITY"  # what makes a small XML file a large one
OTHERS: Mapping[str, str] = {  # what is found in files that are no such database -> what these are
    r"<CANDELA\b": "is a CDD: it describes diagnostics, not frames",
    DECLARES: "holds XML declarations that no signal database needs",
    r"LIN_description_file": "is an LDF: it describes a LIN bus, and LIN is not read",
    r"\A\s*<": "is XML, but neither KCD nor ARXML",
}
LOOKED = 1 << 16
J1939 = r'(?m)^\s*BA_(?:DEF_DEF_)?\s+"ProtocolType"\s+"J1939"'
BEGINS: Mapping[str, str] = {  # where the message {} begins in the text
    DBC: r"^[ \t]*BO_\s+\d+\s+{}\s*:",
    KCD: r'<Message\b[^>]*\bname="{}"',
    SYM: r'^\["?{}"?\]',
    ARXML: r"<SHORT-NAME>{}<",
}


class DatabaseFile(NamedTuple):
    """A database as cantools reads it. `is_j1939`: it says so of all its messages with 29-bit identifiers."""

    kind: str
    messages: list[Any]
    is_j1939: bool


def is_database(path: Path) -> bool:
    """Whether a text begins as one of these does, as far as its first bytes tell."""
    with path.open("rb") as file:
        text = _text(file.read(LOOKED))
    return any(re.search(looks, text) for looks in (*LOOKS.values(), DBC_LOOKS))


def read_database(data: bytes, name: str, notes: list[str]) -> DatabaseFile:
    """A database; what cantools refuses only when strict becomes a note.

    Raises DatabaseError.
    """
    text = _text(data)
    kind = _kind(text, name)
    loader = _loader(kind)
    from cantools.database.errors import Error  # found by its whole name now, without the top of cantools

    is_j1939 = kind == DBC and re.search(J1939, text) is not None
    try:
        return DatabaseFile(kind, _cantools(loader, kind, text, name, strict=True), is_j1939)
    except Error as error:
        why = str(error)
    try:
        messages = _cantools(loader, kind, text, name, strict=False)
    except Error as error:
        raise _refused(kind, text, name, error) from error
    notes.append(f"{name}{_line_of(kind, text, why)}: {why.rstrip('.')}: read all the same")
    return DatabaseFile(kind, messages, is_j1939)


def _text(data: bytes) -> str:
    """UTF-8, another encoding that its letters tell, or else Windows-1252."""
    try:
        text = data.decode(encoding_of(data) or "utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("cp1252", errors="replace")
    return text.replace("\r\n", "\n")


def _kind(text: str, name: str) -> str:
    """What kind of database a text is: DBC where it looks like no other. Raises DatabaseError."""
    head = text[:LOOKED]
    found = next((kind for kind, looks in LOOKS.items() if re.search(looks, head)), None)
    no_database = [DECLARES] if found in (KCD, ARXML) else OTHERS if found is None else []
    for looks in no_database:
        if re.search(looks, head):
            raise DatabaseError(f"{name}: {OTHERS[looks]}. Name a DBC, KCD, SYM or ARXML.")
    return found or DBC


def _loader(kind: str) -> ModuleType:
    """What of cantools reads a kind of database, imported without the top of its package: that brings a tester of buses
    along, so python-can, and asammdf where it is installed. A later `import cantools` finds the whole."""
    name, top = f"cantools.database.can.formats.{kind.lower()}", find_spec("cantools")
    if "cantools" not in sys.modules and top is not None:
        bare = sys.modules["cantools"] = ModuleType("cantools")
        bare.__path__ = list(top.submodule_search_locations or ())
        try:
            return import_module(name)
        finally:
            del sys.modules["cantools"]
    return import_module(name)


def _cantools(loader: ModuleType, kind: str, text: str, name: str, strict: bool) -> list[Any]:
    import textparser
    from cantools.database.errors import Error

    try:
        return list(loader.load_string(text, strict=strict).messages)
    except Error as error:
        if type(error) is not Error:  # not of a message: its text cannot be parsed
            raise _refused(kind, text, name, error) from error
        raise
    except textparser.ParseError as error:
        raise DatabaseError(_not_one(kind, text, name, error.line, error.column)) from error
    except ParseError as error:
        raise DatabaseError(_not_one(kind, text, name, *error.position)) from error
    except Exception as error:  # a foreign parser on foreign bytes: whatever it trips over is the file's
        raise _refused(kind, text, name, error) from error


def _refused(kind: str, text: str, name: str, error: Exception) -> DatabaseError:
    says = " ".join(str(error).split())[:300].rstrip(".") or type(error).__name__
    return DatabaseError(f"{name}{_line_of(kind, text, says)}: {says}. Correct the {kind}, then give it again.")


def _not_one(kind: str, text: str, name: str, line: int, column: int) -> str:
    lines = text.split("\n")
    says = lines[line - 1].strip()[:60] if line <= len(lines) else ""
    what = f'"{says}" is not {kind} at column {column}' if says else f"the {kind} ends before its end"
    return f"{name}:{line}: {what}. Export the database again, or correct the line."


def _line_of(kind: str, text: str, says: str) -> str:
    """ ":12" where the message that an error names begins, nothing where it names none."""
    named = re.search(r"message (\w+)", says)
    begins = named and re.search(BEGINS[kind].format(named[1]), text, re.MULTILINE)
    return f":{text.count(chr(10), 0, begins.start()) + 1}" if begins else ""
