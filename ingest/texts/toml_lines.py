"""Line numbers of the tables, keys and elements of a TOML text, which `tomllib` does not keep; a bound on its depth."""

from __future__ import annotations

import re
from bisect import bisect_left
from collections.abc import Iterator

from ingest.texts.toml_spans import Path, spans

DEEPEST = 32

# A text that nothing ends is one token to the end, and `tomllib` refuses it: looked for again from each of its quotes,
# it would take time by the square of its length.
_TOKEN = re.compile(
    r'"""(?:\\.|[^\\])*?(?:"{3,5}|\\?\Z)'
    r"|'''.*?(?:'{3,5}|\Z)"
    r'|"(?:\\.|[^"\\\n])*(?:"|(?=\n)|\\?\Z)'
    r"|'[^'\n]*(?:'|(?=\n)|\Z)"
    r"|\#[^\n]*|\n|[\[\]{}=,.]|[^\s\[\]{}=,.\#\"']+",
    re.DOTALL,
)


def too_deep(text: str) -> int | None:
    """The line where brackets or the parts of a dotted key nest deeper than `DEEPEST`, None where nowhere."""
    brackets = parts = 0
    for token, line in _tokens(text):
        brackets = max(brackets + (token in ("[", "{")) - (token in ("]", "}")), 0)
        parts = parts + (token == ".") if token not in ("\n", "=", ",") else 0
        if max(brackets, parts) > DEEPEST:
            return line
    return None


def lines(text: str) -> dict[Path, int]:
    """Line (from 1) of every table, key and array element of a text that `tomllib` has accepted: of a table the first
    one that is about it."""
    feeds = [feed.start() for feed in re.finditer("\n", text)]
    found: dict[Path, int] = {}
    for path, span in sorted(spans(text).items(), key=lambda place: place[1].start):
        while path not in found:
            found[path] = bisect_left(feeds, span.start) + 1
            path = path[:-1]
    return found


def _tokens(text: str) -> Iterator[tuple[str, int]]:
    line = 1
    for match in _TOKEN.finditer(text):
        token = match.group()
        if not token.startswith("#"):
            yield token, line
        line += token.count("\n")
