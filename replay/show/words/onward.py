"""The next commands that a text ends with: each runs as it is printed, on the store that was asked."""

from __future__ import annotations

import re
import shlex
from html import escape
from pathlib import Path

from replay.show.words.width import width

DEFAULT_STORE = Path("whyhot-store")
BETWEEN = " · "  # several commands of one line; what is to be done by hand stands before the command
NEXT = re.compile(r"^(next: |(?:Next|Then) {2,})(.*(?:\n {2,}\S.*)*)$", re.MULTILINE)
VERB = re.compile(r"\bwhyhot ([a-z]+)(?![^`·]* --store )(?= |$)")  # one that names no store itself
# what lists or mends a store, what takes back and asks again, and what shows a diagnosis
OF_STORE = "sessions|sql|rebuild|verify|upgrade|report|retract|replay|stale"
SAID = re.compile(rf"(?:(?<=`)|(?<=next: ))whyhot (?:{OF_STORE})(?![^`]* --store )(?=[ `;]|$)")
CODE = re.compile(r"<code>whyhot [a-z]+(?![^<]* --store )(?=[ <])")  # on a page


def onward(text: str, store: Path = DEFAULT_STORE) -> str:
    """`text` with a line for each of its next commands where one line is too short for all, on `store` where that is
    not the default one. What was laid out so already stays."""
    return NEXT.sub(lambda found: found[1] + _laid_out(found[2], len(found[1]), store), text)


def on_store(line: str, store: Path) -> str:
    """The line of a refusal or a note with the store in the commands that it names, where that is not the default."""
    named = f" --store {shlex.quote(str(store))}"
    return line if store == DEFAULT_STORE else SAID.sub(lambda found: found[0] + named, line)


def on_page(html: str, store: Path) -> str:
    """The text of a page with the store in the commands that stand in it as code, where that is not the default."""
    named = escape(f" --store {shlex.quote(str(store))}")
    return html if store == DEFAULT_STORE else CODE.sub(lambda found: f"{found[0]}{named}", html)


def _laid_out(commands: str, indent: int, store: Path) -> str:
    lines = [line.strip() for line in commands.splitlines()]
    if len(lines) > 1 and all(line.startswith("whyhot ") and not line.endswith(BETWEEN.rstrip()) for line in lines):
        return commands
    line = " ".join(lines)
    if store != DEFAULT_STORE:
        line = VERB.sub(lambda found: f"whyhot {found[1]} --store {shlex.quote(str(store))}", line)
    fits = indent + len(line) <= width()
    return line if fits else line.replace(BETWEEN, f"\n{' ' * indent}")
