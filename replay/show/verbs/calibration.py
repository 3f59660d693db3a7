"""A calibration as text: how much better, what moved, what the data leave free, the next command."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from ingest.catalogue.page import table
from replay.show.words import heat_words, words
from replay.show.words.terminal import labelled
from replay.show.words.width import width
from twin.calibration.calibrate import LEFT_FREE

FEW = 8  # names that a person reads


def calibration_text(data: Mapping[str, Any]) -> str:
    """What `whyhot calibrate` prints of its JSON answer. No colours, no trailing newline."""
    lines = labelled("Calibrated", _headline(data))
    lines += ["", *_errors(data["errors"])]
    lines += ["", *_moved(data["parameters"])]
    lines += ["", *labelled("Left free", _free(data["parameters"]))]
    for one in data["profiles"]:
        lines += labelled("Profile", _profile(one))
    return "\n".join([*lines, "", *labelled("Next", f"whyhot replay --model {words.short(data['model'])}")])


def moved(parameter: Mapping[str, Any]) -> bool:
    """Whether an estimate is more than one prior standard deviation from the file's value."""
    return abs(float(parameter["log_change"])) > float(parameter["prior_sd"])


def free(parameter: Mapping[str, Any]) -> bool:
    """Whether the data leave a parameter about as uncertain as it was."""
    return float(parameter["sd"]) > LEFT_FREE * float(parameter["prior_sd"])


def _headline(data: Mapping[str, Any]) -> str:
    names = words.joined([str(session["name"]) for session in data["on"]])
    ended = "converged" if data["converged"] else "NOT converged: take the estimates as a start only"
    return (
        f"{data['motor']} on {names}: {ended} after {data['iterations']} iterations; model "
        f"{words.short(data['model'])} from {words.short(data['parent'])}"
    )


def _errors(errors: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    yield from _thermometers([e for e in errors if "before_K" in e])
    for e in errors:
        if "unit" in e:
            before, after = (heat_words.quantity(e[key], e["unit"]) for key in ("before", "after"))
            course = f"{before} -> {after}" if before != after else f"{before}, unchanged"
            much = "much" if e["gain"] > 0 else "little"
            gain = f", meter reads {100 * abs(e['gain']):.1f} % too {much}" if abs(e["gain"]) > 5e-4 else ""
            yield f"{e['session_name']}  {words.name(str(e['place']))} ({e['channel']})   {course}{gain}"


def _thermometers(errors: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    rows = [(f"{e['session_name']}  {words.name(str(e['node']))} ({e['channel']})", e) for e in errors]
    cells = []
    for label, entry in rows:
        errs = (f"{error} K" for error in words.figures([entry["before_K"], entry["after_K"]]))
        much = abs(float(entry["bias_K"])) > 2 * float(entry["bias_sd_K"])
        note = f", its bias_sd is {words.kelvin(entry['bias_sd_K'])}" if much else ""
        if entry.get("outliers_s"):  # an older calibration does not say
            note += f"; {entry['outliers_s']:.0f} s left out, it jumped away and back"
        cells.append((label, *errs, f"{words.signed_kelvin(entry['bias_K'])}{note}"))
    yield from table(("Mean error of a replay", "before", "after", "sensor reads too much by"), cells, width(), (1, 2))


def _moved(parameters: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    rows = sorted(filter(moved, parameters), key=lambda p: -abs(float(p["log_change"]) / float(p["prior_sd"])))
    if not rows:
        yield from labelled("Moved", "nothing by more than its prior standard deviation")
        return
    head = ("Moved beyond its prior sd", "before", "after", "", "1 sd", "")
    yield from table(head, map(_moved_row, rows), width(), right=(1, 2, 4))


def _moved_row(p: Mapping[str, Any]) -> tuple[str, ...]:
    spread = f"{100.0 * (math.exp(float(p['sd'])) - 1.0):.1f} %"
    values = (words.digits(p["before"]), words.digits(p["value"]), str(p["unit"]))  # an sd of percents leaves no more
    return str(p["name"]), *values, spread, "at its bound" if p["held"] else ""


def _profile(one: Mapping[str, Any]) -> str:
    """ "loss.magnet.speed2 is 86.2 W, 95 % 80.1 to 93 W, by the data alone"."""
    value, low, high = (None if x is None else words.digits(x, 4) for x in (one["value"], *one["ci95"]))
    span = f"{low} to {high} {one['unit']}" if low is not None and high is not None else "not bounded"
    if (low is None) != (high is None):
        span = f"at least {low} {one['unit']}" if high is None else f"at most {high} {one['unit']}"
    return f"{one['name']} is {value} {one['unit']}, 95 %: {span}, by the data alone"


def _free(parameters: Sequence[Mapping[str, Any]]) -> str:
    names = [str(p["name"]) for p in parameters if free(p)]
    if not names:
        return "nothing: the data say something about every parameter"
    kinds = Counter(name.partition(".")[0] for name in names)
    listed = [f"{count} of {kind}" for kind, count in kinds.items()]
    told = ", ".join(names) if len(names) <= FEW else f"{words.joined(listed)}; --json names them under left_free"
    return f"{len(names)} of {len(parameters)} parameters keep over {100 * LEFT_FREE:.0f} % of their prior sd: {told}"
