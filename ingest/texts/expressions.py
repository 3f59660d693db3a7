"""The arithmetic of derived channels: a small grammar of its own, never Python.

    sum     := product (("+" | "-") product)*
    product := signed (("*" | "/") signed)*
    signed  := "-" signed | power
    power   := atom ("**" signed)?
    atom    := number | signal | "(" sum ")" | function "(" sum ("," sum)* ")"

A signal is an identifier, or any name in backquotes. Everything is evaluated in float64, element by element, with the
same bits on every machine (`ingest.texts.powers`).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import lru_cache, reduce
from operator import itemgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ingest.errors import ExpressionError
from ingest.texts.nearest import hint
from ingest.texts.powers import exp, hypot, ln, log10, power

Array = NDArray[np.float64]
LONGEST, DEEPEST = 2000, 50  # characters; parentheses, calls, signs and powers within each other

_TOKEN = re.compile(
    r"\s*(?:(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)(?![\w.])"
    r"|(?P<name>[^\W\d]\w*)|`(?P<quoted>[^`\n]+)`|(?P<sign>\*\*|[-+*/(),]))"
)


FUNCTIONS: Mapping[str, tuple[Callable[..., Any], int | None]] = {  # name -> function, arguments (None: one or more)
    "hypot": (hypot, 2),
    "sqrt": (np.sqrt, 1),
    "abs": (np.abs, 1),
    "exp": (exp, 1),
    "ln": (ln, 1),
    "log": (ln, 1),
    "log10": (log10, 1),
    "pow": (power, 2),
    "min": (lambda *values: reduce(np.minimum, values), None),
    "max": (lambda *values: reduce(np.maximum, values), None),
    "mean": (lambda *values: reduce(np.add, values) / len(values), None),
}
_OPERATORS: Mapping[str, Callable[..., Any]] = {"+": np.add, "-": np.subtract, "*": np.multiply, "/": np.divide}
ALLOWED = f"numbers, signals (others than plain names in `backquotes`), + - * / ** and {' '.join(FUNCTIONS)}"


_Node = Callable[[Mapping[str, Array]], Any]  # the values of the signals -> the value of a part of the expression


@dataclass(frozen=True)
class Expression:
    """A checked expression. `names`: the signals in it, each once, in order of first use."""

    text: str
    names: tuple[str, ...]
    _root: _Node = field(compare=False, repr=False)

    def evaluate(self, values: Mapping[str, NDArray[Any]]) -> Array:
        """Values float64 (N,) from those (N,) of each signal; NaN where an input is NaN or the result not finite."""
        arrays = {name: np.asarray(values[name], dtype=np.float64) for name in self.names}
        with np.errstate(all="ignore"):
            result = np.array(self._root(arrays), dtype=np.float64)
        result[~np.isfinite(result)] = np.nan
        return result


def _called(function: Callable[..., Any], *arguments: _Node) -> _Node:
    return lambda values: function(*(argument(values) for argument in arguments))


@lru_cache(maxsize=256)
def parse(text: str) -> Expression:
    """Check `text` against the grammar above. Raises ExpressionError with the position (from 1) and what is allowed."""
    if len(text) > LONGEST:
        raise ExpressionError(
            f"the expression has {len(text):,} characters, over the limit of {LONGEST:,}: shorten it."
        )
    return _Parser(text).whole()


@dataclass(frozen=True)
class _Token:
    kind: str  # number name quoted sign end
    text: str
    at: int  # from 1


def _tokens(text: str) -> Iterator[_Token]:
    at, end = 0, len(text.rstrip())
    while at < end:
        match = _TOKEN.match(text, at)
        if match is None or match.lastgroup is None:
            at += len(text[at:]) - len(text[at:].lstrip())
            word = re.match(r"[\w.]+|.", text[at:])
            raise _refusal(text, at + 1, f'"{word[0] if word else ""}" is not allowed')
        yield _Token(match.lastgroup, match[match.lastgroup], match.start(match.lastgroup) + 1)
        at = match.end()
    yield _Token("end", "", len(text) + 1)


def _refusal(text: str, at: int, why: str) -> ExpressionError:
    return ExpressionError(f'expression "{text[:80]}", position {at}: {why}. Allowed are {ALLOWED}.')


class _Parser:
    """Recursive descent; one token ahead."""

    def __init__(self, text: str) -> None:
        self._text = text
        self._rest = _tokens(text)
        self._token = next(self._rest)
        self._names: dict[str, None] = {}
        self._depth = 0

    def whole(self) -> Expression:
        root = self._sum()
        if self._token.kind != "end":
            raise self._unexpected("an operator")
        if not self._names:
            raise _refusal(self._text, 1, "no signal is named")
        return Expression(self._text, tuple(self._names), root)

    def _take(self) -> _Token:
        token, self._token = self._token, next(self._rest, self._token)
        return token

    def _sees(self, *signs: str) -> bool:
        return self._token.kind == "sign" and self._token.text in signs

    def _expect(self, sign: str) -> None:
        if not self._sees(sign):
            raise self._unexpected(f'"{sign}"')
        self._take()

    def _unexpected(self, wanted: str) -> ExpressionError:
        found = f'found "{self._token.text}"' if self._token.kind != "end" else "the expression ends"
        return _refusal(self._text, self._token.at, f"{found} where {wanted} is wanted")

    def _chain(self, part: Callable[[], _Node], *signs: str) -> _Node:
        """A sum or product of many terms, first op term op term ...: a loop, so that a long sum is not a deep one."""
        first, rest = part(), []
        while self._sees(*signs):
            rest.append((_OPERATORS[self._take().text], part()))
        if not rest:
            return first
        return lambda values: reduce(lambda left, step: step[0](left, step[1](values)), rest, first(values))

    def _sum(self) -> _Node:
        return self._chain(self._product, "+", "-")

    def _product(self) -> _Node:
        return self._chain(self._signed, "*", "/")

    def _signed(self) -> _Node:
        self._depth += 1
        if self._depth > DEEPEST:
            raise _refusal(self._text, self._token.at, f"nested deeper than {DEEPEST}")
        node = self._negative() if self._sees("-") else self._power()
        self._depth -= 1
        return node

    def _negative(self) -> _Node:
        self._take()
        return _called(np.negative, self._signed())

    def _power(self) -> _Node:
        base = self._atom()
        if not self._sees("**"):
            return base
        self._take()
        return _called(power, base, self._signed())

    def _atom(self) -> _Node:
        if self._token.kind == "number":
            number = np.float64(self._take().text)
            return lambda values: number
        if self._token.kind in ("name", "quoted"):
            return self._named()
        if not self._sees("("):
            raise self._unexpected("a number, a signal or a parenthesis")
        self._take()
        node = self._sum()
        self._expect(")")
        return node

    def _named(self) -> _Node:
        token = self._take()
        if token.kind == "name" and self._sees("("):
            return self._call(token)
        self._names[token.text] = None
        return itemgetter(token.text)

    def _call(self, name: _Token) -> _Node:
        if name.text not in FUNCTIONS:
            raise _refusal(
                self._text, name.at, f'"{name.text}" is no function.{hint(name.text, FUNCTIONS)}'.rstrip(".")
            )
        self._take()
        arguments = [self._sum()]
        while self._sees(","):
            self._take()
            arguments.append(self._sum())
        self._expect(")")
        function, wanted = FUNCTIONS[name.text]
        if wanted not in (None, len(arguments)):
            raise _refusal(self._text, name.at, f"{name.text} takes {wanted} argument(s), found {len(arguments)}")
        return _called(function, *arguments)
