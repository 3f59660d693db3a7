"""What the controller of a motor does as a sensor becomes hot: the `[[derating]]` tables of a bench file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ingest.bench.channel import Channel
from ingest.errors import BenchFileError
from ingest.texts.nearest import hint
from ingest.texts.toml_file import NUMBER, TEXT, TomlTable

DERATING_KEYS = ("channel", "begin_degC", "end_degC")


@dataclass(frozen=True)
class DeratingRule:
    """The current is taken back from `begin_degC` of a channel on, in a straight line down to none at `end_degC`."""

    channel: str  # its name
    begin_degC: float
    end_degC: float


def read_deratings(tables: Sequence[TomlTable], channels: Sequence[Channel]) -> tuple[DeratingRule, ...]:
    """The rules of a bench file with these channels. Raises TomlError, or BenchFileError where a channel is none of its
    thermometers or the temperatures do not rise."""
    return tuple(_rule(table, channels) for table in tables)


def _rule(table: TomlTable, channels: Sequence[Channel]) -> DeratingRule:
    table.only(DERATING_KEYS)
    wanted = table.need("channel", TEXT)
    known = {
        name: one.name
        for one in channels
        if one.quantity == "temperature" and one.role != "ignored"
        for name in (one.name, one.signal or one.name)
    }
    if wanted not in known:
        advice = hint(wanted, known) or " Name a [[channel]] by its signal or a [[derived]] channel by its name."
        raise BenchFileError(f'{table.where("channel")} channel "{wanted}" is no temperature of this bench.{advice}')
    begin, end = table.need("begin_degC", NUMBER), table.need("end_degC", NUMBER)
    if not begin < end:
        raise BenchFileError(
            f"{table.where('end_degC')} end_degC {end:g} is not above begin_degC {begin:g}: "
            "the current falls from the one to the other."
        )
    return DeratingRule(known[wanted], begin, end)
