"""Names that want to be more than names: each as that of a log, a specimen and a channel, and what seven outputs make
of it."""

from __future__ import annotations

import csv
import json
import tomllib
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

from benchmarks.attack import subjects
from benchmarks.attack.children import Verb
from benchmarks.attack.outcome import Arena, Attack, Outcome
from ingest.texts.plain import STEERING, plain, plain_line

STRINGS = (
    *(
        "../../outside",
        "..\\..\\outside",
        "/etc/passwd",
        "~root",
        "-rf",
        "--store=other",
        "$(touch ran)",
        "`touch ran`",
    ),
    *("a;touch ran", "a|touch ran", "a&&touch ran", "%PATH%", "${HOME}", "CON", "NUL.txt", "COM1", "aux", "a.", "a:b"),
    *("=1+1", "=cmd|' /C calc'!A0", "+1", "-1", "@SUM(A1)", "\t=1", '=HYPERLINK("http://x","y")', "a,b", 'a"b', "a;b"),
    *("<script>alert(1)</script>", "<img src=x onerror=alert(1)>", "</title><b>", "&lt;b&gt;", "javascript:alert(1)"),
    *(
        '" onmouseover="alert(1)',
        "{{7*7}}",
        "${7*7}",
        "[a](javascript:alert(1))",
        "<!--",
        "]]>",
        "<svg/onload=alert(1)>",
    ),
    *("'; DROP TABLE base.sessions; --", "' OR '1'='1", "a''b", "%", "_", "a\\", 'a"; x = "1', '"""', "'''", "[table]"),
    *(
        "\x1b[2J",
        "\x9b31m",
        "\x07",
        "\u202egnp",
        "a\u2028b",
        "\ufeffa",
        "a\u200bb",
        "\u212b",
        "A\u030a",
        "x" * 200,
        "0x1F",
    ),
    *("null", "NaN", "true", "1e999", " a "),
)
SHOWN = ("path", "SQL", "HTML", "CSV", "JSON", "TOML", "terminal")
NO_FILE = "/\0\n\r"  # no file is called so
ACTING = ("href", "xlink:href", "src", "srcdoc", "action", "formaction", "style", "data")  # a browser runs or fetches
LONGEST = 200  # bytes of a file's name
ROWS = 20  # of a log


class Page(HTMLParser):
    """What of a page would run, and all its text."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.runs: list[str] = []
        self.text = ""
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        acting = [one for one in attrs if one[0].startswith("on") or one[0] in ACTING]
        self.runs += [f"{name}={value}" for name, value in acting if "alert(1)" in str(value) or value == "x"]

    def handle_data(self, data: str) -> None:
        self.runs += [data] * (self.cdata_elem == "script" and "alert(1)" in data)
        self.text += data


def names(arena: Arena) -> Outcome:
    """T19: a try is one name in one output. All go into one store, where none may become another."""
    outcome, folder = Outcome(), arena.folder / "own"
    folder.mkdir()
    chosen = arena.chance.sample(STRINGS, min(-(-arena.tries // len(SHOWN)), len(STRINGS)))
    for name in chosen:
        for shown, wrong in zip(SHOWN, _wrong(folder, name), strict=False):
            outcome.count(*[f"{name!r} as {shown}: {wrong}"] * bool(wrong))
    strange = {path.name for path in arena.folder.iterdir()} - {"own"}
    outcome.failed += [f"written outside: {strange}"] * bool(strange)
    outcome.failed += ["a command was run"] * (folder / "ran").exists()
    outcome.note = f"{len(chosen)} names, as {', '.join(SHOWN)}"
    return outcome


def _wrong(folder: Path, name: str) -> Iterator[str]:
    """What is wrong with the name in each of `SHOWN`; empty where nothing is."""
    log = _log(folder, name)

    def said(*words: str) -> str:
        code, text = Verb(words, folder).ended()
        if code or "Traceback" in text or STEERING.search(text):
            raise AssertionError(f"{words[0]}: exit code {code}: {text[-200:]!r}")
        return text

    def one(verb: str, *words: str) -> Any:
        return json.loads(said(verb, *words, "--json"))

    def path() -> bool:
        said("ingest", f"./{log}", f"--specimen={name}")
        return True

    def in_json() -> bool:
        return [_session(log, one("sessions"))["specimen"]] == [name]

    def in_sql() -> bool:
        quoted = name.strip().replace("'", "''")
        asked = f"SELECT count(*) AS n FROM samples WHERE channel = '{quoted}' AND session = '{session()}'"
        return bool(one("sql", asked)["rows"] == [{"n": ROWS}])

    def session() -> str:
        return str(_session(log, one("sessions"))["session"])

    def in_html() -> bool:
        said("morning", f"./{log}", "--report", "page.html")
        page = Page((folder / "page.html").read_text(encoding="utf-8"))
        return (
            not page.runs
            and not STEERING.search(page.text)
            and " ".join(plain(log).split()) in " ".join(page.text.split())
        )

    def in_csv() -> bool:
        said("export", session(), "--to", "csv", "--out", "out.csv")
        with (folder / "out.csv").open(encoding="utf-8", newline="") as file:
            head = next(csv.reader(file))
        (folder / "out.csv").unlink()
        runs = [cell for cell in head if cell.startswith(("=", "+", "-", "@", "\t"))]
        return not runs and any(plain_line(name).strip() in cell for cell in head)

    def in_toml() -> bool:
        said("inspect", f"./{log}", "--bench-draft", "draft.toml")
        text = (folder / "draft.toml").read_text(encoding="utf-8")
        (folder / "draft.toml").unlink()
        drafted = [channel["signal"] for channel in tomllib.loads(text)["channel"]]
        called = f"TC_{name}".strip()
        return called in drafted or f"#   {plain_line(called)}" in text.splitlines()  # nothing was guessed for it

    def in_terminal() -> bool:
        said("show", session())
        return True

    for asked in (path, in_sql, in_html, in_csv, in_json, in_toml, in_terminal):
        try:
            yield "" if asked() else "is not what was given, or would run"
        except (AssertionError, OSError, ValueError, KeyError, StopIteration) as error:
            yield f"{type(error).__name__}: {error}"


def _session(log: str, answer: Any) -> Any:
    (found,) = [one for one in answer["sessions"] if one["sources"] == [log]]
    return found


def _log(folder: Path, name: str) -> str:
    """A log called so, as far as a file may be, with a channel of that name and one that is a temperature."""
    subjects.write_table(folder / "made", ROWS, seed=STRINGS.index(name))
    with (folder / "made").open(encoding="utf-8", newline="") as file:
        head, *rows = csv.reader(file)
    called = "".join(one for one in name if one not in NO_FILE).encode()[:LONGEST].decode(errors="ignore")
    log = f"{STRINGS.index(name)} {called}.csv"
    with (folder / log).open("w", encoding="utf-8", newline="") as file:
        csv.writer(file).writerows([[*head[:-2], f"TC_{name}", name], *rows])
    return log


ATTACKS = (
    Attack("T19", "hostile names", "nothing run, written elsewhere or merged", len(STRINGS) * len(SHOWN), 7, names),
)
