"""A first bench file for logs at hand: what can be guessed, and a comment wherever a person must decide."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from functools import reduce
from typing import Any
from unicodedata import normalize

from ingest.bench.signals import Directory, Signal
from ingest.bench.time_tables import Logger
from ingest.errors import UnitError
from ingest.texts.guessing import guess, unit_in_name, words
from ingest.texts.quantities import PEAK, STORED_UNIT, converter

_NOT_DRAFTED = ("counter", "state")  # not needed to replay a motor
_LISTED = 200  # signals that nothing was guessed for

_SPELT = str.maketrans({"ä": "ae", "ö": "oe", "ü": "ue", "ß": "ss"})
_PLACE_WORDS = {  # place -> words for it, short ones, German, Italian, French and Spanish
    "coolant": "cool|coolant|kuehl(w|wasser|mittel)?|raffreddamento|refroidissement|refrigerante",
    "ambient": "amb|umgebung|ambiente|ambiante?",
    "oven": "ofen|forno|etuve|four|horno",
    "winding": "wdg|wndg|wickl|wicklung|avv|avvolg|avvolgimento|bobinage|enroulement|bobinado|devanado",
    "magnet": "mag|magnete?n?|magneti|aimants?|iman(es)?",
    "bearing": "brg|lager|cusc|cuscinetto|palier|roulement|cojinete|rodamiento",
    "housing": "hsg|gehaeuse|carcassa|carter|carcasa",
    "yoke": "joch|giogo|culasse|culata",
    "tooth": "zahn|dente|dents?|diente",
}
_OVEN_OR_4 = "four"  # in French and in English
_NUMBERS = {"one", "two", "three", "five", "seven", "eight"}  # which tell that it is 4
_NO_PLACE = "t|tc|tmp|temp(eratur[ae]?)?"  # where a name begins with it, and says the place behind it

_HEAD = """\
schema = "whyhot.bench/1"
# Draft for {name}: quantities, units and nodes are guessed from names and units. \
Read every line, above all those marked CHECK.
# motor = "motor.toml"         # needed to replay; its nodes and boundaries are then the names to use below
"""
_ONE_SPECIMEN = '# specimen = "motor-01"\n'
_LABELLED = "{key} = {column}  # CHECK: each row is of the {what} that stands in this column\n"
_TIME = """
# {why}
[{table}]
"""
_DAYS = """\
column = {column}  # CHECK: its days are the stamps
"""
_NO_TIME = """\
rate_hz = 1.0                  # CHECK: no time was recognised; how many rows a second?
# start = 2024-03-01T08:00:00Z
"""
_LOCAL = """
# Stamps that name no zone are read as UTC. Where they are local, say so: of all logs here, of one format as \
[time.csv], or of one [[logger]].
# [time]
# zone = "Europe/Berlin"
"""
_LOGGER = """
[[logger]]                     # one clock, whatever its logs are called
name = "{name}"
files = {files}  # CHECK: the names of all its logs
"""
_NODES = """
# Temperatures: `node` is a place in the motor. Without a motor file any name will do, \
and oven*, ambient* and coolant* are
# what surrounds it. Several channels may share a node; role = "ignored" leaves one out.
"""


def draft_bench(
    signals: Sequence[Signal],
    settings: Mapping[str, Any],
    name: str = "these logs",
    at_once: Sequence[Collection[Signal]] = (),
) -> str:
    """The text of a bench file that reads and resolves against `signals`; `name` of the logs, for its first comment.

    `at_once`: signals that are recorded together, by logger; of others, two of a quantity are no rivals. Without it all
    are.

    `settings`: `texts`, the columns that hold text, which have no quantity; `untimed`, why a log has no time: `[time]`
    is there to be filled in, or names the column of `days`; of one `format` alone, where logs of others have theirs, or
    of the `logger` that wrote it; `absolute`, whether a log has dates; `labels`, the columns of a table that tell
    "specimen" and "batch" of each row; `loggers`, what wrote the logs.
    """
    directory = Directory(signals)
    found = {reference: signal for signal in signals if (reference := _reference(signal, directory))}
    texts = {one for one, signal in found.items() if not signal.message and signal.name in settings.get("texts", ())}
    guessed = {one: guess(signal.name, signal.unit) for one, signal in found.items() if one not in texts}
    known = {reference: quantity for reference, quantity in guessed.items() if quantity not in (None, *_NOT_DRAFTED)}
    inputs = [reference for reference, quantity in known.items() if quantity != "temperature"]
    places = [reference for reference, quantity in known.items() if quantity == "temperature"]
    rivals = _rivals({found[one]: str(quantity) for one, quantity in known.items()}, at_once or [signals])
    parts = [_HEAD.format(name=_comment(name)), *_labelled(settings.get("labels", {})), _untimed(settings)]
    parts += [_logger(one, settings) for one in settings.get("loggers", ())]
    parts += [_entry(found[one], one, str(known[one]), found[one] in rivals) for one in inputs]
    parts += [_phase_current(found, known, directory)]
    parts += [_NODES if places else ""]
    numbered = any(not _NUMBERS.isdisjoint(_words(one.name)) for one in signals)
    nodes = _told_apart({one: _without_unit(found[one].name) for one in places}, numbered)
    parts += [_entry(found[one], one, "temperature", False, node) for one, node in nodes.items()]
    said = (*settings.get("labels", {}).values(), settings.get("days"))
    left = [one for reference, one in found.items() if reference not in known and (one.message or one.name not in said)]
    return "".join([*parts, *_rest(left)])


def _labelled(labels: Mapping[str, str]) -> Iterator[str]:
    """The lines that say which specimen, and of which batch, the logs are of: by columns of theirs, where these do."""
    if "specimen" not in labels:
        yield _ONE_SPECIMEN
    for what, column in labels.items():
        yield _LABELLED.format(key=f"{what}_column", column=_text(column), what=what)


def _untimed(settings: Mapping[str, Any]) -> str:
    """`[time]`, where nothing says the times of a log, unless its logger does; and where to say the zone of stamps."""
    why, form = settings.get("untimed"), settings.get("format")
    local = _LOCAL if settings.get("absolute") else ""
    if not why or settings.get("logger"):
        return local
    return local + _TIME.format(why=_comment(why), table=f"time.{form}" if form else "time") + _told_time(settings)


def _logger(one: Logger, settings: Mapping[str, Any]) -> str:
    """A `[[logger]]`; that of a log whose times nothing says has the keys that `[time]` would have."""
    table = _LOGGER.format(name=one.name, files=_text(one.files))
    if one.name != settings.get("logger"):
        return table
    why = _comment(settings["untimed"]).replace("Under [time] of the bench file", "Here")
    return f"{table}# {why}\n{_told_time(settings)}"


def _told_time(settings: Mapping[str, Any]) -> str:
    days = settings.get("days")
    return _DAYS.format(column=_text(days)) if days else _NO_TIME


def _rivals(known: Mapping[Signal, str], at_once: Sequence[Collection[Signal]]) -> set[Signal]:
    """Signals that another one of their quantity is recorded together with."""
    found: set[Signal] = set()
    for together in at_once:
        often = Counter(known[one] for one in known if one in together)
        found |= {one for one in known if one in together and often[known[one]] > 1}
    return found


def _reference(signal: Signal, directory: Directory) -> str | None:
    """The shortest name that means this signal alone; None where none does, or none can be written."""
    names = (signal.name, f"{signal.message}.{signal.name}", signal.alone)
    fits = (name for name in names if name.strip() and directory.find(name) == [signal])
    return next((name for name in fits if not re.search("[\ud800-\udfff]", name)), None)


def _entry(signal: Signal, reference: str, quantity: str, shared: bool, node: str = "") -> str:
    unit, peak, doubt = _unit(signal, quantity)
    lines = [
        "[[channel]]",
        f"signal = {_text(reference)}",
        f'quantity = "{quantity}"' + (f"  # CHECK: several signals look like {quantity}; keep one" if shared else ""),
        f"unit = {_text(unit)}" + doubt,
    ]
    if quantity in PEAK:
        lines.append(_convention(peak))
    if node:
        lines.append(f'node = "{node}"')
    return "\n" + "\n".join(lines) + "\n"


def _convention(peak: bool) -> str:
    return 'convention = "peak"' if peak else '# convention = "peak"         # where the log holds amplitudes'


def _phase_current(found: Mapping[str, Signal], known: Mapping[str, str | None], directory: Directory) -> str:
    """The current that losses follow, from its parts along d and q: "" where it is recorded itself, or not each part
    once and in one unit."""
    parts = [[one for one, quantity in known.items() if quantity == axis] for axis in ("current_d", "current_q")]
    if "current" in known.values() or directory.find("current") or [len(part) for part in parts] != [1, 1]:
        return ""
    (d,), (q,) = parts
    unit, peak, doubt = _unit(found[d], "current_d")
    written = [one if one.isascii() and one.isidentifier() else f"`{one}`" for one in (d, q)]
    if _unit(found[q], "current_q") != (unit, peak, doubt) or any("`" in one for one in (d, q)):
        return ""
    lines = [
        "[[derived]]                    # what copper losses follow",
        'name = "current"',
        'quantity = "current"',
        f"unit = {_text(unit)}{doubt}",
        _convention(peak),
        f"expression = {_text(f'hypot({written[0]}, {written[1]})')}",
    ]
    return "\n" + "\n".join(lines) + "\n"


def _unit(signal: Signal, quantity: str) -> tuple[str, bool, str]:
    """Unit text, whether of peak values, and a comment where the log leaves it open."""
    for convention in ("rms", "peak") if signal.unit else ():
        try:
            converter(str(signal.unit), quantity, convention)
            return str(signal.unit), convention == "peak", ""
        except UnitError:
            continue
    says = f"says {_comment(signal.unit)}, which is not known" if signal.unit else "does not say"
    return STORED_UNIT[quantity], False, f"  # CHECK: the log {says}"


def _without_unit(name: str) -> str:
    """A name without the unit that it ends in: "T_Rücken" of `T_Rücken [°C]`, "EW_3" of `EW_3_degC`."""
    unit = unit_in_name(name)
    bare = re.sub(r"\s*\[[^\[\]]*\]\s*$", "", name)
    ends = (f"({unit})", f"_{unit}", f" in {unit}")
    return reduce(str.removesuffix, ends, bare.partition(f", {unit}")[0]).strip() or name


def _words(name: str) -> list[str]:
    """The words of a name in plain letters: "T_Rücken" -> t, ruecken."""
    plain = normalize("NFKD", words(normalize("NFC", name)).translate(_SPELT)).encode("ascii", "ignore").decode()
    return [word for word in plain.split("_") if word]


def _node(name: str, numbered: bool) -> str:
    """ "T_EndWinding.A" -> "endwinding_a", "T_Kühlw_ein" -> "coolant_ein": a node name, from the words of a signal;
    `numbered`: `four` is 4."""
    kept = _words(name)
    if len(kept) > 1 and re.fullmatch(_NO_PLACE, kept[0]):
        kept = kept[1:]
    if len(kept) > 1 and kept[0].isdigit():  # of an input, as in 101 <Wicklung>
        kept = [*kept[1:], kept[0]]
    node = "_".join(word if numbered and word == _OVEN_OR_4 else _place_of(word) for word in kept)
    return node if node and node[0].isalpha() else f"node_{node}".rstrip("_")


def _told_apart(names: Mapping[str, str], numbered: bool) -> dict[str, str]:
    """Reference -> node, of `names` by reference: those that are alike but for letters that a node cannot have are
    numbered, "コイル温度" and "外気温" node_1 and node_2."""
    nodes = {one: _node(name, numbered) for one, name in names.items()}
    alike: dict[str, list[str]] = {}  # node -> the names that came to it
    for one, node in nodes.items():
        if names[one] not in (own := alike.setdefault(node, [])):
            own.append(names[one])
    return {
        one: f"{node}_{own.index(names[one]) + 1}" if len(own := alike[node]) > 1 and any(map(_loses, own)) else node
        for one, node in nodes.items()
    }


def _loses(name: str) -> bool:
    """Whether a name has letters that are none in plain ones."""
    return any(letter.isalpha() and not normalize("NFKD", letter).encode("ascii", "ignore") for letter in name)


def _place_of(word: str) -> str:
    """The place as a motor file is likely to call it; a word that is none stays."""
    return next((place for place, begins in _PLACE_WORDS.items() if re.fullmatch(begins, word)), word)


def _rest(left: Sequence[Signal]) -> Iterator[str]:
    if left:
        yield "\n# Nothing was guessed for (kept as the log has them; name them above if the motor needs them):\n"
    for signal in left[:_LISTED]:
        yield f"#   {_comment(str(signal))}" + (f" [{_comment(signal.unit)}]" if signal.unit else "") + "\n"
    if len(left) > _LISTED:
        yield f"#   and {len(left) - _LISTED:,} more\n"


def _text(text: str) -> str:
    """A TOML basic string: JSON's, but for the one control character that JSON lets through."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _comment(text: str) -> str:
    return "".join(character if character.isprintable() else "?" for character in text)
