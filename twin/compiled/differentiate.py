"""Derivatives of straight-line text, by the rules of calculus: the laws of a network are written once, in `twin.compiled.codegen`.

A line is `name = expression` of sums, products, quotients, square roots, `min`, `max` and conditions; every name is assigned
once.
"""

from __future__ import annotations

import ast
from collections.abc import Sequence


class Derivative:
    """By one name. `lines`: the derivatives of the given lines that are not zero, to stand behind them."""

    def __init__(self, lines: Sequence[str], by: str) -> None:
        self._slopes = {by: "1.0"}
        self.lines: list[str] = []
        for name, text in (line.split(" = ", 1) for line in lines):
            slope = self.of(text)
            if slope is not None and name != by:
                self.lines.append(f"{name}_by_{by} = {slope}")
                self._slopes[name] = f"{name}_by_{by}"

    def of(self, text: str) -> str | None:
        """The derivative of an expression of those lines; None where it is zero."""
        return self._of(ast.parse(text, mode="eval").body)

    def _of(self, node: ast.expr) -> str | None:
        match node:
            case ast.Name(id=name):
                return self._slopes.get(name)
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                slope = self._of(operand)
                return None if slope is None else f"(-{slope})"
            case ast.BinOp(left=left, op=op, right=right):
                return _of_two(op, (_text(left), self._of(left)), (_text(right), self._of(right)))
            case ast.Call(func=ast.Attribute(attr="sqrt"), args=[inner]):
                slope = self._of(inner)
                return None if slope is None else f"({slope} / (2.0 * {_text(node)}))"
            case ast.Call(func=ast.Name(id="min" | "max" as which), args=[first, second]):
                sign = "<" if which == "min" else ">"
                slopes = self._of(first), self._of(second)
                return _either(slopes, f"{_text(first)} {sign} {_text(second)}")
            case ast.IfExp(test=test, body=body, orelse=other):
                return _either((self._of(body), self._of(other)), _text(test))
        return None


def _text(node: ast.expr) -> str:
    return f"({ast.unparse(node)})" if isinstance(node, ast.BinOp | ast.UnaryOp | ast.IfExp) else ast.unparse(node)


def _either(slopes: tuple[str | None, str | None], test: str) -> str | None:
    if slopes == (None, None):
        return None
    return f"({slopes[0] or '0.0'} if {test} else {slopes[1] or '0.0'})"


def _of_two(op: ast.operator, first: tuple[str, str | None], second: tuple[str, str | None]) -> str | None:
    (left, by_left), (right, by_right) = first, second
    if isinstance(op, ast.Add | ast.Sub):
        if by_right is None:
            return by_left
        if by_left is None:
            return by_right if isinstance(op, ast.Add) else f"(-{by_right})"
        return f"({by_left} {'+' if isinstance(op, ast.Add) else '-'} {by_right})"
    if isinstance(op, ast.Mult):
        parts = [_product(by_left, right), _product(by_right, left)]
        there = [part for part in parts if part is not None]
        return f"({' + '.join(there)})" if there else None
    if by_right is None:
        return None if by_left is None else f"({by_left} / {right})"
    fall = f"{left} * {by_right} / ({right} * {right})"
    return f"(-{fall})" if by_left is None else f"({by_left} / {right} - {fall})"


def _product(slope: str | None, factor: str) -> str | None:
    if slope is None:
        return None
    return factor if slope == "1.0" else f"{slope} * {factor}"
