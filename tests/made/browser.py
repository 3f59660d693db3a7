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
const [still, narrow] = [...document.querySelectorAll("iframe")].map(frame => frame.contentDocument);
const found = [];
still.querySelectorAll("svg").forEach(svg => {
  const box = svg.getBoundingClientRect(), title = svg.getAttribute("aria-label");
  if (box.height < 5) found.push(`${title}: is not drawn without script`);
  const texts = [...svg.querySelectorAll("text")].filter(t => t.textContent.trim())
    .map(t => [t.textContent.trim(), t.getBoundingClientRect()]);
  texts.forEach(([text, a], i) => {
    if (a.left < box.left - 1 || a.right > box.right + 1 || a.top < box.top - 2 || a.bottom > box.bottom + 2)
      found.push(`${title}: "${text}" is cut`);
    texts.slice(i + 1).forEach(([other, b]) => {
      const wide = Math.min(a.right, b.right) - Math.max(a.left, b.left);
      const high = Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top);
      if (wide > 1 && high > 0.35 * Math.min(a.height, b.height))
        found.push(`${title}: "${text}" lies over "${other}", ${wide.toFixed(1)} x ${high.toFixed(1)} points`);
    });
  });
});
"""  # cut or over one another, in the pictures of the first frame
FAULTS = """
if (!still.querySelector(".answer").textContent.trim()) found.push("without script there is no answer");
if (still.querySelector("button, input")) found.push("without script something is there to be pressed");
const whole = narrow.documentElement, beyond = whole.scrollWidth - whole.clientWidth;
if (beyond > 0) found.push(`on a telephone the page is ${beyond} points wider than the screen`);
narrow.querySelectorAll("svg text").forEach(text => {
  const high = text.getBoundingClientRect().height;
  if (high > 0 && high < 9) found.push(`on a telephone "${text.textContent}" is ${high} points high`);
});
[still, narrow].forEach(page => page.querySelectorAll("td.name").forEach(cell => {
  const names = page.createTreeWalker(cell, NodeFilter.SHOW_TEXT), range = page.createRange();
  if (cell.offsetWidth < parseFloat(page.defaultView.getComputedStyle(cell).maxWidth) - 1)
    while (names.nextNode()) for (const {0: word, index} of names.currentNode.data.matchAll(/[^\\s_.-]+/g)) {
      range.setStart(names.currentNode, index);
      range.setEnd(names.currentNode, index + word.length);
      if (range.getClientRects().length > 1) found.push(`"${word}" is broken within, in a column of names`);
    }
}));
narrow.querySelectorAll("details").forEach(fold => { fold.open = true; });
const {told, axe} = narrow.defaultView;
found.push(...told);
if (!axe) return found;
return axe.run(narrow, {resultTypes: ["violations"]}).then(({violations}) => [...found, ...violations.map(
  one => `${one.help}, ${one.nodes.length} times: ${one.nodes[0].html.slice(0, 200)}`)]);
"""
WATCHED = """<meta http-equiv="Content-Security-Policy"
  content="default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'">
<script>
var told = [];
addEventListener("error", event => told.push(`its script: ${event.message}`));
addEventListener("securitypolicyviolation", event => told.push(`it fetches ${event.blockedURI}`));
</script>"""  # the page's own policy but for the scripts that find faults
AXE = ROOT / "node_modules" / "axe-core" / "axe.min.js"  # what keeps people from using a page


def faults(page: Path) -> list[str]:
    """What is wrong with a page: labels of pictures that are cut or lie over one another, names that break within a
    word before their column is full, where it is too wide or too small on a telephone, errors of its script, what it
    fetches, what does not work without script, and what axe-core finds where that is there (npm install --no-save
    axe-core@4.14.1). The test is skipped where Chromium is not installed."""
    text = POLICY.sub("", page.read_text(encoding="utf-8"))
    axe = AXE.read_text(encoding="utf-8").replace("</script", "<\\/script") if AXE.is_file() else ""
    told = text.replace("<head>", f"<head>{WATCHED}").replace("</body>", f"<script>{axe}</script></body>")
    frames = _frame(text, 1000, "sandbox=allow-same-origin") + _frame(told, 390)
    found: list[str] = _asked(page, f"<!doctype html><body>{frames}</body>", f"{LABELS} {FAULTS}")
    return found


def label_faults(picture: Path) -> list[str]:
    """Labels of a picture in a file of its own that are cut or lie over one another. The test is skipped where Chromium
    is not installed."""
    drawn = picture.read_text(encoding="utf-8")
    page = f"<!doctype html><style>svg {{ width: 940px; height: auto }}</style>{drawn[drawn.index('<svg') :]}"
    found: list[str] = _asked(picture, f"<!doctype html><body>{_frame(page, 1000)}</body>", f"{LABELS} return found;")
    return found


def _frame(text: str, width: int, attribute: str = "") -> str:
    style = f"width: {width}px; height: 900px; border: 0"
    return f'<iframe {attribute} style="{style}" srcdoc="{html.escape(text)}"></iframe>'


def in_browser(page: Path, script: str) -> Any:
    """What `script` (the body of a function) returns, or promises, on a page. The test is skipped where Chromium is not
    installed."""
    return _asked(page, POLICY.sub("", page.read_text(encoding="utf-8")), script)


def _asked(page: Path, text: str, script: str) -> Any:
    """What `script` finds on a page of this text, which lies beside `page`, once all of it is there."""
    assert text.count("</body>") == 1
    ask = (
        f"<script>const p = document.createElement('pre'); p.id = 'found'; addEventListener('load', () => "
        f"(async () => {{ {script} }})().catch(error => [error.stack]).then(found => {{ "
        "p.textContent = JSON.stringify(found); document.body.append(p); }))</script></body>"
    )
    asked = page.with_name("asked.html")
    asked.write_text(text.replace("</body>", ask), encoding="utf-8")
    done = _dom(asked)
    told = re.search(r'<pre id="found">(.*?)</pre>', done.stdout, re.DOTALL)
    assert told is not None, done.stderr[-2000:]
    return json.loads(html.unescape(told[1]))


def as_it_stands(page: Path) -> str:
    """The page as a browser has it after its own script ran under the page's own policy."""
    return _dom(page).stdout


def printed_pages(page: Path) -> int:
    """On how many sheets of paper the page is printed; 0 where Chromium is not installed."""
    if not _program():
        return 0
    paper = page.with_suffix(".pdf")
    _chromium(page, "--no-pdf-header-footer", f"--print-to-pdf={paper}")
    return max(map(int, re.findall(rb"/Type\s*/Pages[^>]*?/Count\s+(\d+)", paper.read_bytes())))


def _dom(page: Path) -> subprocess.CompletedProcess[str]:
    if not _program():
        pytest.skip("Chromium is not installed: apt install chromium")
    return _chromium(page, "--virtual-time-budget=60000", "--window-size=1000,900", "--dump-dom")


def _program() -> str:
    names = ("chromium", "chromium-browser", "google-chrome")
    return next(filter(None, map(shutil.which, names)), "")


def _chromium(page: Path, *flags: str) -> subprocess.CompletedProcess[str]:
    command = [_program(), "--headless", "--no-sandbox", "--disable-gpu", *flags, page.as_uri()]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
