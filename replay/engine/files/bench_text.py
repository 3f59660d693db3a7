"""A bench file with other corrections, and other nodes that its sensors follow: what is new is added at its end."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import timedelta
from typing import Any

from ingest.bench.bench_file import Bench, read_bench
from ingest.bench.channel import Channel
from ingest.bench.corrections import Correction, correct
from ingest.bench.laws import SWAP
from ingest.errors import BenchFileError, TomlError
from ingest.formats import EPOCH
from replay.engine.files.toml_edit import edited

Weights = Mapping[str, Mapping[str, float]]  # name of a channel -> node -> share


def corrected(
    data: bytes,
    name: str,
    corrections: Mapping[str, float],
    says: str,
    weights: Weights | None = None,
    at_ns: int | None = None,
) -> bytes:
    """The bench file `data` (`name` as in messages) with `corrections` (cause id -> amount) beside its own, and with
    `weights` in the place of the node of their channel: shares that add up to 1.

    A correction that the file has already takes the amount that is as good as both, one after the other
    (`ingest.bench.laws`: the sum; of gains (1 + a) (1 + b) - 1); one that is new is appended under the comment `says`.
    In a file with changes the new ones hold as long as the channels mean what they mean at `at_ns` [ns UTC].
    Amounts and shares have 7 digits; all else stays as written. Raises BenchFileError for a cause that this bench
    cannot have, an exchange of sensors that are exchanged already, shares of a sensor that a change concerns, and a
    file whose tables cannot be added to.
    """
    before, weights = read_bench(data, name), weights or {}
    _refuse_moved(before, weights)
    text = _with_weights(data.decode("utf-8-sig"), before, weights, says)
    own = read_bench(text.encode(), name)
    wanted = _together(own, corrections, at_ns)
    old, new = ([{"amount": one.amount} for one in some] for some in (own.corrections, wanted))
    text = edited(text, {"correction": old}, {"correction": new[: len(old)]}, says)
    if len(wanted) > len(old):
        text = text.rstrip("\r\n") + "\n\n" + _added(wanted[len(old) :], says)
    _compare(text.encode(), before, wanted, weights, at_ns)
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


def _refuse_moved(bench: Bench, weights: Weights) -> None:
    for one in bench.changes:
        if one.other and one.after.name in weights:
            raise BenchFileError(
                f"{bench.name}:{one.line}: what {one.after.name} follows was learnt anew, and a change says other "
                "things of this channel: write its shares yourself."
            )


def _together(bench: Bench, corrections: Mapping[str, float], at_ns: int | None) -> list[Correction]:
    """The file's own corrections with what is to be added to them, then the new ones."""
    wanted, now, span = list(bench.corrections), bench.at(at_ns), bench.unchanged(at_ns)
    held = [i for i, one in enumerate(bench.corrections) if one in now.corrections]  # places of those that hold then
    for cause, amount in corrections.items():
        new = Correction(cause, amount, *span)
        *before, target = correct(bench.name, now.channels, [*(wanted[i] for i in held), new]).targets
        if target not in before:
            held.append(len(wanted))
            wanted.append(new)
            continue
        at = held[before.index(target)]
        if target.law == SWAP:
            raise BenchFileError(
                f'{bench.name}: correction "{cause}": these two sensors are exchanged already, in line '
                f"{wanted[at].line}: take that [[correction]] out instead."
            )
        wanted[at] = replace(wanted[at], amount=new.rule.both(wanted[at].amount, amount))
    return wanted


def _added(new: Sequence[Correction], says: str) -> str:
    comment = "".join(f"# {part}\n" for part in says.splitlines())
    return comment + "\n".join(_table(one) for one in new)


def _table(one: Correction) -> str:
    dates = {"from": one.from_ns, "until": one.until_ns}
    lines = [f"{key} = {_moment(t_ns)}\n" for key, t_ns in dates.items() if t_ns is not None]
    return f'[[correction]]\ncause = "{one.cause}"\namount = {one.amount:.7g}\n' + "".join(lines)


def _moment(t_ns: int) -> str:
    return (EPOCH + timedelta(microseconds=t_ns // 1000)).isoformat().replace("+00:00", "Z")


def _compare(result: bytes, before: Bench, wanted: Sequence[Correction], weights: Weights, at_ns: int | None) -> None:
    """Raises BenchFileError where the written file does not say what it should."""
    try:
        found = read_bench(result, before.name)
    except TomlError:
        found = before
    causes = [one.cause for one in found.corrections] == [one.cause for one in wanted]
    amounts = causes and all(
        abs(a.amount - b.amount) <= 1e-6 * abs(b.amount) for a, b in zip(found.corrections, wanted, strict=True)
    )
    old, new = (correct(b.name, b.channels, b.corrections).targets for b in (before.at(at_ns), found.at(at_ns)))
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
