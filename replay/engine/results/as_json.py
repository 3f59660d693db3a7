"""A dataclass as JSON and back: its fields are the keys, in their order; the field `from_` is the key `from`, which is
no name in Python. A field marked with `IF_SAID` is in the JSON only where it is neither None nor empty."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from types import UnionType
from typing import Any, get_args, get_origin, get_type_hints

IF_SAID = {"if_said": True}  # metadata of a field


def to_json(value: Any) -> Any:
    """JSON of a dataclass, or of lists and dicts of them; numbers, text and None are themselves."""
    if is_dataclass(value):
        given = ((one, getattr(value, one.name)) for one in fields(value))
        return {_key(one.name): to_json(v) for one, v in given if v or "if_said" not in one.metadata}
    if isinstance(value, Mapping):
        return {key: to_json(one) for key, one in value.items()}
    return [to_json(one) for one in value] if isinstance(value, list) else value


def from_json(kind: Any, stored: Any) -> Any:
    """What `to_json` wrote of a `kind`, a dataclass or the type of a field. A key that is not there has its field's
    default, one that is no field is left out."""
    inner = get_args(kind)
    if stored is None:
        return None
    if isinstance(kind, type) and is_dataclass(kind):
        return kind(**{n: from_json(of, stored[_key(n)]) for n, of in _types(kind).items() if _key(n) in stored})
    if get_origin(kind) is UnionType:  # something or None
        return from_json(inner[0], stored)
    if get_origin(kind) is dict:
        return {key: from_json(inner[1], one) for key, one in stored.items()}
    return [from_json(inner[0], one) for one in stored] if get_origin(kind) is list else stored


_types = cache(get_type_hints)


def _key(name: str) -> str:
    return name.removesuffix("_")
