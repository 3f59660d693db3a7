"""A bench file with corrections: a table is appended for each, or the amount of one that says the same is replaced."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

from ingest.bench import Bench, read_bench
from ingest.corrections import MASKED, SWAP, Correction, composed, correct
from ingest.errors import BenchFileError, TomlError
from ingest.toml_lines import lines

_AMOUNT = re.compile(r"(\bamount\s*=\s*)[+-]?[0-9][0-9_]*(?:\.[0-9_]+)?(?:[eE][+-]?[0-9]+)?")


def corrected(data: bytes, name: str, corrections: Mapping[str, float], says: str) -> bytes:
    """The bench file `data` (`name` as in messages) with what is wrong beyond its own corrections: cause id -> amount.

    A correction that the file has already takes the amount that is as good as both, one after the other
    (`ingest.corrections.composed`: the sum; of gains (1 + a) (1 + b) - 1); one that is new is appended under the comment
    `says`. Amounts have 7 digits; all else stays as written. Raises BenchFileError for a cause that this bench cannot have, an
    exchange of sensors that are exchanged already, and a file whose tables cannot be added to.
    """
    bench = read_bench(data, name)
    wanted = _together(bench, corrections)
    text = data.decode("utf-8-sig").splitlines(keepends=True)
    where = lines("".join(text))
    for i, (before, after) in enumerate(zip(bench.corrections, wanted, strict=False)):
        if after != before:
            line = where["correction", i, "amount"] - 1
            text[line] = _AMOUNT.sub(rf"\g<1>{after.amount:.7g}", text[line], count=1)
    result = ("".join(text).rstrip("\r\n") + "\n\n" + _added(wanted[len(bench.corrections) :], says)).encode()
    _compare(result, bench, wanted)
    return result


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
        elif new.law not in MASKED:
            at = before.index(target)
            wanted[at] = replace(wanted[at], amount=composed(new.law, wanted[at].amount, amount))
    return wanted


def _added(new: Sequence[Correction], says: str) -> str:
    comment = "".join(f"# {part}\n" for part in says.splitlines())
    return comment + "\n".join(f'[[correction]]\ncause = "{one.cause}"\namount = {one.amount:.7g}\n' for one in new)


def _compare(result: bytes, before: Bench, wanted: Sequence[Correction]) -> None:
    """Raises BenchFileError where the written file does not say what it should."""
    try:
        found = read_bench(result, before.name)
    except TomlError:
        found = before
    causes = [one.cause for one in found.corrections] == [one.cause for one in wanted]
    amounts = causes and all(
        abs(a.amount - b.amount) <= 1e-6 * abs(b.amount) for a, b in zip(found.corrections, wanted, strict=True)
    )
    if not amounts or found.channels != before.channels:
        raise BenchFileError(
            f"{before.name}: its corrections cannot be added to: write each as a [[correction]] table, cause and amount on "
            "a line of their own."
        )
