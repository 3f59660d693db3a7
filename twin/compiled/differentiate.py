"""Derivatives of straight-line text, by the rules of calculus: the laws of heat are written once
(`twin.motor.heat_laws`), and nobody writes their slopes.

A line is `name = expression`. An expression has sums, products, quotients, square roots, `min`, `max` and
comparisons, which count as 1 where they hold and else as 0. Every name is assigned once.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Mapping, Sequence

_PRODUCT_OF_NAMES = re.compile(r"-?[\w.]+( \* [\w.]+)*")


class Derivative:
    """The derivatives of lines by one name. `lines` of it stand behind the given ones: a line for each of these whose
    derivative is neither zero nor a mere product of names. `known`: derivatives of names that no line assigns.

    >>> Derivative(["x = 1.0 / (1.0 + a * t)", "y = x * t + b"], "t").lines
    ['y_by_t = (-a * x * x * t + x)']

    Where all lines see the name through one of them, such as `gap = far - own`, they are derivatives by that: those
    by `far` and by `own` are then the same, up to a sign.
    """

    def __init__(self, lines: Sequence[str], by: str, known: Mapping[str, str] | None = None) -> None:
        self._slopes = {by: "1.0", **(known or {})}
        self._names: dict[str, str] = {}  # expression -> the name that a line gives it
        through, self._sign = (by, "1.0") if known else self._seen_through(lines, by)
        if through != by:
            self._slopes |= {by: self._sign, through: "1.0"}
        self.lines: list[str] = []
        for name, text in (line.split(" = ", 1) for line in lines):
            body = ast.parse(text, mode="eval").body
            self._names[ast.unparse(body)] = name
            slope = None if name in (by, through) else self._of(body)
            if slope is not None and _PRODUCT_OF_NAMES.fullmatch(slope):
                self._slopes[name] = slope
            elif slope is not None:
                self.lines.append(f"{name}_by_{through} = {slope}")
                self._slopes[name] = f"{name}_by_{through}"

    def _seen_through(self, lines: Sequence[str], by: str) -> tuple[str, str]:
        """The name of the one line that has `by` in it and grows, or falls, just as `by` does, and 1.0 or -1.0; else
        `by` itself."""
        seen = [line.split(" = ", 1) for line in lines if re.search(rf"\b{by}\b", line)]
        slope = self._of(ast.parse(seen[0][1], mode="eval").body) if len(seen) == 1 else None
        return (seen[0][0], slope) if slope in ("1.0", "-1.0") else (by, "1.0")

    def of(self, text: str) -> str | None:
        """The derivative of an expression of those lines; None where it is zero."""
        slope = self._of(ast.parse(text, mode="eval").body)
        return negated(slope) if slope is not None and self._sign == "-1.0" else slope

    def _of(self, node: ast.expr) -> str | None:
        """A product without brackets about it, its sign in front. Raises `ValueError` where there is no rule."""
        match node:
            case ast.Name(id=name):
                return self._slopes.get(name)
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                slope = self._of(operand)
                return None if slope is None else negated(slope)
            case ast.BinOp(left=left, op=ast.Add() | ast.Sub() as op, right=right):
                return _sum(self._of(left), self._of(right), isinstance(op, ast.Sub))
            case ast.BinOp(left=left, op=ast.Mult(), right=right):
                by_left, by_right = self._of(left), self._of(right)
                first = None if by_left is None else _product(by_left, self._text(right))
                second = None if by_right is None else _product(self._unbracketed(left), by_right)
                return _sum(first, second)
            case ast.BinOp(left=left, op=ast.Div(), right=right):
                return self._of_quotient(node, left, right)
            case ast.Call(func=ast.Attribute(attr="sqrt"), args=[inner]):
                return self._of_root(node, inner, 2.0)
            case ast.Call(func=ast.Name(id="min" | "max" as which), args=[one, another]):
                a, b = self._text(one), self._text(another)
                tests = (f"({a} <= {b})", f"({b} < {a})")
                of_one, of_another = tests if which == "min" else tests[::-1]
                by_one, by_another = self._of(one), self._of(another)
                first = None if by_one is None else _product(by_one, of_one)
                return _sum(first, None if by_another is None else _product(by_another, of_another))
            case ast.Constant() | ast.Compare():
                return None
        raise ValueError(f"there is no rule for the derivative of {ast.unparse(node)}")

    def _of_quotient(self, node: ast.expr, left: ast.expr, right: ast.expr) -> str | None:
        by_left, by_right = self._of(left), self._of(right)
        first = None if by_left is None else f"{by_left} / {self._text(right)}"
        if by_right is None:
            return first
        whole = self._text(node)
        if isinstance(left, ast.Constant) and left.value == 1.0:
            return negated(_product(_product(by_right, whole), whole))
        return _sum(first, f"{_product(whole, by_right)} / {self._text(right)}", minus=True)

    def _of_root(self, node: ast.expr, inner: ast.expr, order: float) -> str | None:
        """Roots of roots at once: a division costs more than all else here."""
        match inner:
            case ast.Call(func=ast.Attribute(attr="sqrt"), args=[within]):
                return self._of_root(node, within, 2.0 * order)
        slope = self._of(inner)
        return None if slope is None else f"{_product(slope, self._text(node))} / ({order!r} * {self._text(inner)})"

    def _text(self, node: ast.expr) -> str:
        """The name of an expression that a line has, else the expression, fit to be part of a product."""
        text = ast.unparse(node)
        composed = isinstance(node, ast.BinOp | ast.UnaryOp | ast.Compare)
        return self._names.get(text) or (f"({text})" if composed else text)

    def _unbracketed(self, node: ast.expr) -> str:
        """The text of a node at the head of a product, where a product needs no brackets."""
        text = ast.unparse(node)
        if text not in self._names and isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mult | ast.Div):
            return text
        return self._text(node)


def negated(slope: str) -> str:
    """An expression as `Derivative` gives them, its sign changed."""
    return slope.removeprefix("-") if slope.startswith("-") else f"-{slope}"


def _product(first: str, second: str) -> str:
    """The product of two expressions; signs go in front, a factor of 1 is left out."""
    if second.startswith("-"):
        return negated(_product(first, second.removeprefix("-")))
    if first in ("1.0", "-1.0"):
        return first.removesuffix("1.0") + second
    return first if second == "1.0" else f"{first} * {second}"


def _sum(first: str | None, second: str | None, minus: bool = False) -> str | None:
    """The sum of two slopes, or where `minus` their difference."""
    if second is not None and minus:
        second = negated(second)
    if first is None or second is None:
        return first if second is None else second
    sign, rest = ("-", second.removeprefix("-")) if second.startswith("-") else ("+", second)
    return f"({first} {sign} {rest})"
