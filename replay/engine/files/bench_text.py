"""A bench file with corrections and what its sensors follow: both are written where they stand,
what is new is added."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from ingest.bench.bench_file import Bench, read_bench
from ingest.bench.channel import Channel
from ingest.bench.corrections import Correction, correct
from ingest.bench.laws import SWAP
from ingest.errors import BenchFileError, TomlError
from ingest.texts.toml_lines import lines
from replay.engine.files.toml_edit import edited

_AMOUNT = re.compile(r"(\bamount\s*=\s*)[+-]?[0-9][0-9_]*(?:\.[0-9_]+)?(?:[eE][+-]?[0-9]+)?")

Weights = Mapping[str, Mapping[str, float]]  # name of a channel -> node -> share


def corrected(
    data: bytes, name: str, corrections: Mapping[str, float], says: str, weights: Weights | None = None
) -> bytes:
    """The bench file `data` (`name` as in messages) with what is wrong beyond its own corrections: cause id -> amount;
    and with what channels follow: `weights`, shares that add up to 1, in the place of their node.

    A correction that the file has already takes the amount that is as good as both, one after the other
    (`ingest.bench.laws`: the sum; of gains (1 + a) (1 + b) - 1); one that is new is appended under the comment `says`.
    Amounts and shares have 7 digits; all else stays as written. Raises BenchFileError for a cause that this bench
    cannot have, an exchange of sensors that are exchanged already, and a file whose tables cannot be added to.
    """
    before = read_bench(data, name)
    whole = _with_weights(data.decode("utf-8-sig"), before, weights or {}, says)
    bench = read_bench(whole.encode(), name)
    wanted = _together(bench, corrections)
    text = whole.splitlines(keepends=True)
    where = lines(whole)
    for i, (old, new) in enumerate(zip(bench.corrections, wanted, strict=False)):
        if new != old:
            line = where["correction", i, "amount"] - 1
            text[line] = _AMOUNT.sub(rf"\g<1>{new.amount:.7g}", text[line], count=1)
    added = wanted[len(bench.corrections) :]
    result = (
        "".join(text).encode() if not added else ("".join(text).rstrip("\r\n") + "\n\n" + _added(added, says)).encode()
    )
    _compare(result, before, wanted, weights or {})
    return result


def _with_weights(text: str, bench: Bench, weights: Weights, says: str) -> str:
    """A node becomes a table of shares where it stands; shares that are there take their new numbers."""
    tables = {kind: entries for kind, entries in tomllib.loads(text).items() if kind in ("channel", "derived")}
    names = iter(bench.channels)  # those with a signal first, as they are read
    wanted: dict[str, Any] = {
        kind: [_following(entry, weights.get(next(names).name)) for entry in tables[kind]]
        for kind in ("channel", "derived")
        if kind in tables
    }
    return edited(text, tables, wanted, says.partition("\n")[0])


def _following(entry: dict[str, Any], shares: Mapping[str, float] | None) -> dict[str, Any]:
    return entry if shares is None else {**entry, "weights" if "weights" in entry else "node": dict(shares)}


def _together(bench: Bench, corrections: Mapping[str, float]) -> list[Correction]:
    """The file's own corrections with what is to be added to them, then the new ones."""
    wanted = list(bench.corrections)
    for cause, amount in corrections.items():
        new = Correction(cause, amount)
        *before, target = correct(bench.name, bench.channels, [*wanted, new]).targets
        if target not in before:
            wanted.append(new)
        elif target.law == SWAP:
            raise BenchFileError(
                f'{bench.name}: correction "{cause}": these two sensors are exchanged already, in line '
                f"{wanted[before.index(target)].line}: take that [[correction]] out instead."
            )
        else:
            at = before.index(target)
            wanted[at] = replace(wanted[at], amount=new.rule.both(wanted[at].amount, amount))
    return wanted


def _added(new: Sequence[Correction], says: str) -> str:
    comment = "".join(f"# {part}\n" for part in says.splitlines())
    return comment + "\n".join(f'[[correction]]\ncause = "{one.cause}"\namount = {one.amount:.7g}\n' for one in new)


def _compare(result: bytes, before: Bench, wanted: Sequence[Correction], weights: Weights) -> None:
    """Raises BenchFileError where the written file does not say what it should."""
    try:
        found = read_bench(result, before.name)
    except TomlError:
        found = before
    causes = [one.cause for one in found.corrections] == [one.cause for one in wanted]
    amounts = causes and all(
        abs(a.amount - b.amount) <= 1e-6 * abs(b.amount) for a, b in zip(found.corrections, wanted, strict=True)
    )
    old, new = (correct(b.name, b.channels, b.corrections).targets for b in (before, found))
    channels = [_plain(one, weights) for one in before.channels] == [_plain(one, {}) for one in found.channels]
    if not amounts or not channels or new[: len(old)] != old:
        raise BenchFileError(
            f"{before.name}: its corrections cannot be added to: write each as a [[correction]] table, cause and "
            "amount on a line of their own, and call a sensor that shares its node node@signal."
        )


def _plain(channel: Channel, weights: Weights) -> Channel:
    """A channel by what it says, wherever it stands, following what `weights` say."""
    if channel.name in weights:
        channel = replace(channel, node=None, weights=dict(weights[channel.name]))
    return replace(channel, line=0)
