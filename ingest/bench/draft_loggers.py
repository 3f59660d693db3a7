"""Which loggers wrote the logs at hand, as far as the names of their files tell: `[[logger]]` tables of a draft."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Collection, Mapping, Sequence

from ingest.bench.signals import BUS
from ingest.bench.time_tables import Logger

_NUMBER = re.compile(r"(\d+)")
_LETTER = re.compile(r"[^\W\d_]")
_STEM_END = re.compile(r"\.(?!\d)")  # but not the dots of "thermo_14.03.2025.csv"


def loggers(logs: Mapping[str, Collection[str]]) -> list[Logger]:
    """The loggers of tables: name of a file -> its columns. Tables with the same columns are of one logger; there are
    none where all are, where names do not tell them apart, as "thermo_2025-03-14.csv" and "power_2025-03-14.csv" do, or
    where names hold no number, so that they are those of loggers already."""
    by_columns: dict[frozenset[str], list[str]] = defaultdict(list)
    for log, columns in logs.items():
        by_columns[frozenset(columns)].append(log)
    found = [one for own in by_columns.values() if (one := _logger(own))]
    told = len({one.name for one in found}) == len(found) == len(by_columns)
    alone = all(sum(one.wrote(log) for one in found) == 1 for log in logs)
    numbered = any("*" in one.files.removesuffix(".*") for one in found)
    return found if len(found) > 1 and told and alone and numbered else []


def _logger(logs: Sequence[str]) -> Logger | None:
    """The logger of these logs, called by the words that their names share; None where they differ in more than
    numbers: "run07_thermo.csv" and "run08_thermo.csv" are `run*_thermo.*`, and "thermo_7.csv" beside "thermo_8_2.csv",
    the second part of a run, `thermo_*`."""
    stems = [_NUMBER.split(_STEM_END.split(log)[0]) for log in logs]  # words and numbers in turn
    if len({(len(stem), *stem[::2]) for stem in stems}) == 1:
        pattern = _with_numbers(stems)
    elif len({stem[0] for stem in stems}) == 1 and not any(_LETTER.search("".join(stem[2::2])) for stem in stems):
        pattern = f"{stems[0][0]}*"  # as many numbers as each has
    else:
        return None
    pattern = re.sub(r"\*[\W_*]*\*", "*", re.sub(r"[?\[\]]", "?", pattern))  # a day is one number
    name = "_".join(re.findall(r"[a-z0-9]+", pattern.casefold()))
    if not name[:1].isalpha() or re.fullmatch(BUS, name):
        return None
    return Logger(name, pattern if pattern.endswith("*") else f"{pattern}.*", None)


def _with_numbers(stems: Sequence[Sequence[str]]) -> str:
    """The words that all have, with `*` for each number that tells them apart."""
    pattern = stems[0][0]
    for before, numbers, after in zip(
        stems[0][::2], zip(*(stem[1::2] for stem in stems), strict=True), stems[0][2::2], strict=False
    ):
        a_part = before[-1:].isalpha() and len(set(numbers)) == 1  # the 1 of "logger1"
        pattern += (numbers[0] if a_part else "*") + after
    return pattern
