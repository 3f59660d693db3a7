"""Text that goes out to people: what would steer a terminal or hide other text is written out as JSON writes it."""

from __future__ import annotations

import json
import re

# Control characters but tab and line feed, line separators, what changes the direction of text, what has no width,
# halves of a character, tags.
STEERING = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\xad\u061c\u180e\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff\ufff9-\ufffb"
    "\ud800-\udfff\U000e0000-\U000e0fff]"
)


def plain(text: str) -> str:
    """`text` with `\\u001b` in place of an escape character, and so on; JSON stays the same JSON."""
    return STEERING.sub(_written_out, text)


def plain_line(text: str) -> str:
    """As `plain`, on one line: tabs and line feeds are written out too."""
    return plain(text).replace("\t", "\\t").replace("\n", "\\n")


def _written_out(found: re.Match[str]) -> str:
    return json.dumps(found[0])[1:-1]
