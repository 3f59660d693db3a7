"""The page that every report is written on: its templates, and how they write numbers and names."""

from __future__ import annotations

import re
from base64 import b64encode
from hashlib import sha256
from importlib.resources import files
from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined, Template
from markupsafe import Markup, escape

from ingest.texts.plain import plain
from ingest.texts.times import clock
from replay.show.words import findings, heat_words, words
from replay.show.words.onward import on_page
from replay.show.words.palette import variables


def template(name: str) -> Template:
    """A template, with the colours of both pages as `light` and `dark`; a name that is missing is an error."""
    environment = Environment(
        loader=PackageLoader("replay.show", ""),
        autoescape=True,
        finalize=_plain,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    script = files("replay.show").joinpath("explore.js").read_text(encoding="utf-8")
    digest = b64encode(sha256(script.encode()).digest()).decode()
    environment.globals.update(script=Markup(script), script_hash=Markup(f"'sha256-{digest}'"))  # ours: no name in it
    environment.globals.update(light=variables(dark=False), dark=variables(dark=True))
    environment.globals.update(less=words.less)
    environment.filters.update(
        kelvin=words.kelvin,
        unbroken=_unbroken,
        breaking=_breaking,
        meanerror=findings.mean_error,
        figures=words.figures,
        digits=words.digits,
        signed_kelvin=words.signed_kelvin,
        where=words.where,
        nodename=words.name,
        capital=words.capital,
        duration=words.duration,
        quantity=heat_words.quantity,
        clock=clock,
        contents=_contents,
        on_store=_on_store,
        coded=_coded,
        svg=Markup,  # drawn by us, with every name escaped
    )
    return environment.get_template(name)


def _plain(value: object) -> object:
    """What a page writes, which no name can steer; what was drawn by us is plain already."""
    return plain(value) if type(value) is str else value


def _unbroken(text: str) -> str:
    """A number and its unit, and "6.1 → 0.9 K", stay on one line."""
    return re.sub(r"(?<=\d) (?=[°%→A-Za-z])|(?<=→) ", "\N{NO-BREAK SPACE}", text.replace("->", "→"))


def _breaking(name: str) -> Markup:
    """A name that may go on in a new line behind "_", "-" and ".", rather than within a word."""
    return Markup(re.sub(r"(?<=[_.-])(?=.)", "<wbr>", str(escape(plain(name)))))


def _coded(note: str) -> Markup:
    """A note with what is to be typed, between backquotes, as code."""
    return Markup(re.sub(r"`([^`]+)`", r"<code>\1</code>", str(escape(plain(note)))))


def _on_store(body: str, store: Path) -> Markup:
    """The page with the store in its commands."""
    return Markup(on_page(body, store))  # written by a template, with every name escaped


def _contents(body: str) -> Markup:
    """The sections of a page with links to each of them above; a page of one section needs none."""
    sections = re.findall(r"<h2>(.*?)</h2>", body)
    if len(sections) < 2:
        return Markup(body)  # written by a template, with every name escaped
    links = "".join(f'<a href="#section-{i}">{title}</a> ' for i, title in enumerate(sections, 1))
    numbers = iter(range(1, len(sections) + 1))
    marked = re.sub(r"<h2>", lambda _: f'<h2 id="section-{next(numbers)}">', body)
    return Markup(f'<nav aria-label="Contents">{links}</nav>\n{marked}')
