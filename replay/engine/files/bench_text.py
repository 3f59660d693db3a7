"""A bench file with other corrections, and other nodes that its sensors follow: what is new is added at its end."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from ingest.bench.bench_file import Bench, read_bench
from ingest.bench.channel import Channel
from ingest.bench.corrections import Correction, correct
from ingest.bench.laws import SWAP
from ingest.errors import BenchFileError, TomlError
from replay.engine.files.toml_edit import edited

Weights = Mapping[str, Mapping[str, float]]  # name of a channel -> node -> share


def corrected(
    data: bytes, name: str, corrections: Mapping[str, float], says: str, weights: Weights | None = None
) -> bytes:
    """The bench file `data` (`name` as in messages) with `corrections` (cause id -> amount) beside its own, and with
    `weights` in the place of the node of their channel: shares that add up to 1.

    A correction that the file has already takes the amount that is as good as both, one after the other
    (`ingest.bench.laws`: the sum; of gains (1 + a) (1 + b) - 1); one that is new is appended under the comment `says`.
    Amounts and shares have 7 digits; all else stays as written. Raises BenchFileError for a cause that this bench
    cannot have, an exchange of sensors that are exchanged already, and a file whose tables cannot be added to.
    """
    before, weights = read_bench(data, name), weights or {}
    text = _with_weights(data.decode("utf-8-sig"), before, weights, says)
    own = read_bench(text.encode(), name)
    wanted = _together(own, corrections)
    old, new = ([{"amount": one.amount} for one in some] for some in (own.corrections, wanted))
    text = edited(text, {"correction": old}, {"correction": new[: len(old)]}, says)
    if len(wanted) > len(old):
        text = text.rstrip("\r\n") + "\n\n" + _added(wanted[len(old) :], says)
    _compare(text.encode(), before, wanted, weights)
    return text.encode()


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
    """A channel without its line, following what `weights` say."""
    if channel.name in weights:
        channel = replace(channel, node=None, weights=dict(weights[channel.name]))
    return replace(channel, line=0)
