"""A page in Chromium: laid out, with what a script then finds on it."""

from __future__ import annotations

import html
import json
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

from made.places import ROOT

POLICY = re.compile(r'<meta http-equiv="Content-Security-Policy"[^>]*>')
LABELS = """
const found = [];
document.querySelectorAll("svg").forEach(svg => {
  const box = svg.getBoundingClientRect(), title = svg.getAttribute("aria-label");
  const texts = [...svg.querySelectorAll("text")].filter(t => t.textContent.trim())
    .map(t => [t.textContent.trim(), t.getBoundingClientRect()]);
  texts.forEach(([text, a], i) => {
    if (a.left < box.left - 1 || a.right > box.right + 1 || a.top < box.top - 2 || a.bottom > box.bottom + 2)
      found.push(`${title}: "${text}" is cut`);
    texts.slice(i + 1).forEach(([other, b]) => {
      const wide = Math.min(a.right, b.right) - Math.max(a.left, b.left);
      const high = Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top);
      if (wide > 1 && high > 0.35 * Math.min(a.height, b.height))
        found.push(`${title}: "${text}" lies over "${other}"`);
    });
  });
});
return found;
"""


NARROWEST = 500  # of Chromium's own window; what is narrower stands in a frame of it


def axe() -> str:
    """The script that finds what keeps people from using a page, with what it found as its result. The test is skipped
    where axe-core is not there."""
    path = ROOT / "node_modules" / "axe-core" / "axe.min.js"
    if not path.is_file():
        pytest.skip("axe-core is not here: npm install --no-save axe-core@4.14.1")
    found = "found.violations.map(one => [one.id, one.nodes.map(node => node.html.slice(0, 200))])"
    source = path.read_text(encoding="utf-8").replace("</script", "<\\/script")
    return f"{source}; return axe.run(document, {{resultTypes: ['violations']}}).then(found => {found});"


def in_browser(page: Path, script: str, width: int = 1000) -> Any:
    """What `script` (the body of a function) returns, or promises, on a page `width` points wide. The test is skipped
    where Chromium is not installed."""
    text = page.read_text(encoding="utf-8")
    assert text.count("</body>") == 1
    ask = (
        f"<script>const p = document.createElement('pre'); p.id = 'found'; document.body.append(p); "
        f"Promise.resolve((() => {{ {script} }})()).then(found => {{ p.textContent = JSON.stringify(found); }})"
        "</script></body>"
    )
    asked = page.with_name("asked.html")
    whole = POLICY.sub("", text).replace("</body>", ask)
    asked.write_text(whole if width >= NARROWEST else _framed(whole, width), encoding="utf-8")
    done = _dom(asked, width)
    told = re.search(r'<pre id="found">(.*?)</pre>', done.stdout, re.DOTALL)
    assert told is not None, done.stderr[-2000:]
    return json.loads(html.unescape(told[1]))


def _framed(page: str, width: int) -> str:
    """A page that holds another as wide as that, and takes what was found there."""
    return (
        f'<body><iframe style="width: {width}px; height: 900px; border: 0" srcdoc="{html.escape(page)}"></iframe>'
        "<script>const frame = document.querySelector('iframe');"
        "frame.onload = () => document.body.append(frame.contentDocument.getElementById('found'));"
        "</script></body>"
    )


def as_it_stands(page: Path) -> str:
    """The page as a browser has it after its own script ran under the page's own policy."""
    return _dom(page, 1000).stdout


def printed_pages(page: Path) -> int:
    """On how many sheets of paper the page is printed; 0 where Chromium is not installed."""
    if not _program():
        return 0
    paper = page.with_suffix(".pdf")
    _chromium(page, "--no-pdf-header-footer", f"--print-to-pdf={paper}")
    return max(map(int, re.findall(rb"/Type\s*/Pages[^>]*?/Count\s+(\d+)", paper.read_bytes())))


def _dom(page: Path, width: int) -> subprocess.CompletedProcess[str]:
    if not _program():
        pytest.skip("Chromium is not installed: apt install chromium")
    return _chromium(page, "--virtual-time-budget=60000", f"--window-size={width},900", "--dump-dom")


def _program() -> str:
    names = ("chromium", "chromium-browser", "google-chrome")
    return next(filter(None, map(shutil.which, names)), "")


def _chromium(page: Path, *flags: str) -> subprocess.CompletedProcess[str]:
    command = [_program(), "--headless", "--no-sandbox", "--disable-gpu", *flags, page.as_uri()]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
