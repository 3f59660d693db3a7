"""The protocol's outcome as JSON and as text as wide as the terminal."""

from __future__ import annotations

import shlex
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np

from replay.engine.results.as_json import to_json
from replay.engine.results.summary import Summary
from replay.show.verbs.intake import session_json
from replay.show.words import words
from replay.show.words.onward import BETWEEN
from replay.show.words.terminal import labelled
from replay.studies.characterise.protocol import MOVES_K, Protocol, of_interest
from replay.studies.diagnosis.question import LEAST_S

SHOWN = 12  # parameters that a person reads
ENOUGH = 0.9  # of what all points not run would teach: so many are said to be worth running
RISE_K = 0.1  # by which an error must rise to be told
WORSE_K = 0.2  # by which a filter must be worse than the open loop for that to be explained


def document(found: Protocol) -> dict[str, Any]:
    """`whyhot.protocol/1`."""
    event, weighed = found.calibration.event, found.influence
    moved = {p["name"]: p for p in event.parameters}
    fitted = set(found.fitted)

    def by_node(values: Iterable[float]) -> dict[str, float]:
        return dict(zip(weighed.nodes, map(float, values), strict=True))

    return {
        "schema": "whyhot.protocol/1",
        "motor": event.motor,
        "parent": event.parent,
        "model": event.model,
        "calibration": event.calibration,
        "warnings": list(found.warnings),
        "converged": event.converged,
        "points": [session_json(session) for session in found.points],
        "drives": [session_json(session) for session in found.drives],
        "influence": [
            {
                **moved[weighed.parameters[i].name],
                "fitted": weighed.parameters[i].name in fitted,
                "per_prior_sd_K": by_node(weighed.per_sd_K[i]),
            }
            for i in weighed.order(of_interest(found.network))
        ],
        "unknown_before_K": by_node(found.unknown_K),
        "choice": [
            {
                **session_json(found.points[choice.test]),
                "gain_nats": choice.gain,
                "unknown_after_K": by_node(choice.known_K),
            }
            for choice in found.choices
        ],
        "proposed": [
            {"says": p.words, "gain_nats": p.gain, "hours": p.hours, "unknown_after_K": by_node(p.known_K)}
            for p in found.proposals
        ],
        "checked": [
            {
                "session": after.session,
                "session_name": after.session_name,
                "before_mae_K": before.mae_K,
                "after_mae_K": after.mae_K,
                "filtered": to_json(after.filtered),
            }
            for before, after in zip(found.before, found.after, strict=True)
        ],
    }


def protocol_text(found: Protocol) -> str:
    """What `whyhot protocol` prints. No colours, no trailing newline."""
    lines = [line for warning in found.warnings for line in labelled("Motor file", warning)]
    lines += ["", *labelled("Answer", answer(found))] if lines else labelled("Answer", answer(found))
    lines += ["", *_influence(found)]
    lines += ["", *_points(found)]
    if found.proposals:
        lines += ["", *labelled("Next points", next_points(found))]
    lines += ["", *_checked(found), ""]
    for text in filter_notes(found):
        lines += labelled("Filter", text)
    return "\n".join([*lines, *labelled("Next", BETWEEN.join(_commands(found)))])


def _commands(found: Protocol) -> list[str]:
    """What to type next; the drives are asked for a cause where they are long enough."""
    model, drives = words.short(found.calibration.event.model), shlex.join(one.name for one in found.drives)
    enough = sum(one.end_ns - one.start_ns for one in found.drives) / 1e9 >= LEAST_S
    return [f"whyhot replay --model {model}"] + [f"whyhot diagnose --on {drives} --model {model}"] * enough


def answer(found: Protocol) -> str:
    """The error on the drive cycles before and after, at the node that was worst, and which got worse."""
    errors = checked(found)
    node, errors_K = max(errors.items(), key=lambda one: one[1][0])
    before, after = words.figures(errors_K)
    worse = max(errors, key=lambda name: errors[name][1] - errors[name][0])
    rose = errors[worse][1] - errors[worse][0] >= RISE_K
    but = f"; worse: {words.name(worse)} {words.became(errors[worse])} K" if rose else ""
    ended = "" if found.calibration.event.converged else " The fit did not converge: take it as a start only."
    return (
        f"Fitted to {words.joined([s.name for s in found.points])}, {found.network.name} is {after} K off at the "
        f"{words.name(node)} on {words.joined([s.name for s in found.drives])} (before {before} K), from which "
        f"nothing was learnt{but}. {len(found.fitted)} of {len(found.influence.parameters)} parameters were "
        f"fitted.{ended}"
    )


def checked(found: Protocol) -> dict[str, tuple[float, float]]:
    """Node -> mean absolute error over the drives [K], before and after."""
    nodes = dict.fromkeys(node for summary in found.before for node in summary.mae_K)
    both = {node: [_mean(some, node) for some in (found.before, found.after)] for node in nodes}
    return {node: (values[0], values[1]) for node, values in both.items()}


def _mean(summaries: Sequence[Summary], node: str) -> float:
    values = [(one.mae_K[node], one.duration_s) for one in summaries if node in one.mae_K]
    return float(sum(v * t for v, t in values) / sum(t for _, t in values))


def _influence(found: Protocol) -> Iterator[str]:
    weighed = found.influence
    nodes = of_interest(found.network)
    order = weighed.order(nodes)[:SHOWN]
    width = max(len(weighed.parameters[i].name) for i in order)
    yield f"{'Influence on windings and magnets, per prior sd':<{max(width, 48)}} most at"
    moved = {p["name"]: p for p in found.calibration.event.parameters}
    for i in order:
        parameter = weighed.parameters[i]
        node = max(nodes, key=lambda n: weighed.per_sd_K[i, n])
        one = moved[parameter.name]
        was, now = (words.digits(one[key], 4) for key in ("before", "value"))
        value = f"{was} -> {now} {one['unit']}" if was != now else f"{was} {one['unit']}, unchanged"
        size = f"{weighed.per_sd_K[i, node]:>6.1f} K {words.name(weighed.nodes[node])}"
        yield f"{parameter.name:<{max(width, 48)}} {size:<28} {value}".rstrip()
    small = len(weighed.parameters) - len(found.fitted)
    if small:
        yield f"{small} parameters move no node by {MOVES_K} K and stay as the file says"


def _points(found: Protocol) -> Iterator[str]:
    """Point by point, the two nodes that are least known before anything is learnt."""
    nodes = found.influence.nodes
    least = sorted(of_interest(found.network), key=lambda i: -found.unknown_K[i])[:2]
    names = " and ".join(words.name(nodes[i]) for i in least)
    yield f"What each point teaches; what is left unknown on the drive cycles at {names}"
    recorded = [f"{one.name} ({one.kind})" for one in (found.points[choice.test] for choice in found.choices)]
    width = max(28, *map(len, [*recorded, *(one.words for one in found.proposals)]))

    def row(label: str, nats: str, left: Sequence[float]) -> str:
        return f"{label:<{width}} {nats:>10}   " + "  ".join(f"{left[i]:>5.2f} K" for i in least)

    yield row("before any", "", found.unknown_K)
    for label, choice in zip(recorded, found.choices, strict=True):
        yield row(label, f"{choice.gain:.1f} nats", choice.known_K.tolist())
    if found.proposals:
        yield "Not run yet, each beside all above it, those that teach most an hour first"
    for one in found.proposals:
        yield row(one.words, f"{one.gain:.1f} nats", one.known_K.tolist())


def next_points(found: Protocol) -> str:
    """How many of the proposed points, the first ones, teach most of what all of them would."""
    gains = np.cumsum([one.gain for one in found.proposals])
    count = int(np.argmax(gains >= ENOUGH * gains[-1])) + 1
    first = found.proposals[:count]
    share, teach = f"{100 * gains[count - 1] / gains[-1]:.0f} %", "teaches" if count == 1 else "teach"
    names, hours = words.joined([one.words for one in first]), sum(one.hours for one in first)
    return f"{names} {teach} {share} of what all {len(found.proposals)} would, in {hours:.1f} h"


def _checked(found: Protocol) -> Iterator[str]:
    errors = checked(found)
    width = max(len(words.name(node)) for node in errors)
    yield f"{'Mean error, drives':<{max(width, 20)}} {'before':>9} {'after':>9}"
    for node, (before, after) in sorted(errors.items(), key=lambda one: -one[1][0]):
        was, now = words.figures([before, after])
        yield f"{words.name(node):<{max(width, 20)}} {was:>7} K {now:>7} K"


def filter_notes(found: Protocol) -> Iterator[str]:
    """A line for each drive: what the filter makes of channels that it was not given; and why, where it is worse."""
    worse = False
    for summary in found.after:
        filtered, channels = summary.filtered, {one.channel: one for one in summary.channels}
        kept = {name: mae for name, mae in filtered.mae_K.items() if name in channels} if filtered else {}
        worse |= any(mae > channels[name].mae_K + WORSE_K for name, mae in kept.items())
        parts = [f"{n} {words.kelvin(mae)} (open loop {words.kelvin(channels[n].mae_K)})" for n, mae in kept.items()]
        if filtered and parts:
            read = f"{words.counted(len(filtered.measured), 'channel')} and an unknown heat"
            at = words.name(filtered.node)
            yield f"{summary.session_name}: from {read} at the {at}, the kept {words.joined(parts)}"
    if worse:
        yield (
            "the open loop may be nearer: it begins with the kept channel's own first reading, and the filter believes "
            f"a thermometer that is off{_off(found)}; a [[correction]] in the bench file takes that off"
        )


def _off(found: Protocol) -> str:
    """By the calibration, the worst constant error of the channels that a filter read, in words: of those whose error
    has one sign on every point."""
    read = {channel for summary in found.after if summary.filtered for channel in summary.filtered.measured}
    errors = defaultdict(list)
    for one in found.calibration.event.errors:
        if "bias_K" in one and one["channel"] in read:
            errors[one["channel"]].append(float(one["bias_K"]))
    means = {name: float(np.mean(some)) for name, some in errors.items() if len({bias > 0 for bias in some}) == 1}
    worst = max(means, key=lambda name: abs(means[name]), default=None)
    if worst is None:
        return ""
    much = "much" if means[worst] > 0 else "little"
    return f" (by the calibration {worst} reads {words.kelvin(abs(means[worst]))} too {much})"
