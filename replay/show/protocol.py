"""The protocol's outcome as JSON and as text, 100 columns wide."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from replay.show import words
from replay.show.terminal import labelled
from replay.studies.protocol import MOVES_K, Protocol, of_interest

SHOWN = 12  # parameters that a person reads


def document(found: Protocol) -> dict[str, Any]:
    """`whyhot.protocol/1`."""
    event, weighed = found.calibration.event, found.influence
    moved = {p["name"]: p for p in event.parameters}
    fitted = set(found.fitted)
    return {
        "schema": "whyhot.protocol/1",
        "motor": event.motor,
        "parent": event.parent,
        "model": event.model,
        "calibration": event.calibration,
        "warnings": list(found.warnings),
        "converged": event.converged,
        "points": [_session(session) for session in found.points],
        "drives": [_session(session) for session in found.drives],
        "influence": [
            {
                **moved[weighed.parameters[i].name],
                "fitted": weighed.parameters[i].name in fitted,
                "per_prior_sd_K": dict(zip(weighed.nodes, map(float, weighed.per_sd_K[i]), strict=True)),
            }
            for i in weighed.order(of_interest(found.network))
        ],
        "unknown_before_K": dict(zip(weighed.nodes, found.unknown_K, strict=True)),
        "choice": [
            {
                **_session(found.points[choice.test]),
                "gain_nats": choice.gain,
                "unknown_after_K": dict(zip(weighed.nodes, map(float, choice.known_K), strict=True)),
            }
            for choice in found.choices
        ],
        "proposed": [{"says": p.words, "gain_nats": p.gain, "hours": p.hours} for p in found.proposals],
        "checked": [
            {
                "session": after["session"],
                "session_name": after["session_name"],
                "before_mae_K": before["mae_K"],
                "after_mae_K": after["mae_K"],
                "filtered": after["filtered"],
            }
            for before, after in zip(found.before, found.after, strict=True)
        ],
    }


def _session(session: Any) -> dict[str, str]:
    return {"session": session.session, "name": session.name, "kind": session.kind}


def protocol_text(found: Protocol) -> str:
    """What `whyhot protocol` prints. No colours, no trailing newline."""
    event = found.calibration.event
    lines = [line for warning in found.warnings for line in labelled("Motor file", warning)]
    lines += ["", *labelled("Answer", answer(found))] if lines else labelled("Answer", answer(found))
    lines += ["", *_influence(found)]
    lines += ["", *_points(found)]
    for proposal in found.proposals[:1]:
        lines += labelled("Next point", f"{proposal.words}: {proposal.gain:.1f} nats in {proposal.hours:.1f} h")
    lines += ["", *_checked(found), ""]
    for text in filter_notes(found):
        lines += labelled("Filter", text)
    model = words.short(event.model)
    return "\n".join([*lines, *labelled("Next", f"whyhot replay --model {model} · whyhot diagnose --model {model}")])


def answer(found: Protocol) -> str:
    """The error on the drive cycles before and after, at the node that was worst."""
    errors = checked(found)
    node, (before, after) = max(errors.items(), key=lambda one: one[1][0])
    ended = "" if found.calibration.event.converged else " The fit did not converge: take it as a start only."
    return (
        f"Fitted to {words.joined([s.name for s in found.points])}, {found.network.name} is {after:.1f} K off at the "
        f"{words.name(node)} on {words.joined([s.name for s in found.drives])} (before {before:.1f} K), from which nothing "
        f"was learnt; {len(found.fitted)} of {len(found.influence.parameters)} parameters were fitted.{ended}"
    )


def checked(found: Protocol) -> dict[str, tuple[float, float]]:
    """Node -> mean absolute error over the drives [K], before and after."""
    nodes = dict.fromkeys(node for summary in found.before for node in summary["mae_K"])
    both = {node: [_mean(some, node) for some in (found.before, found.after)] for node in nodes}
    return {node: (values[0], values[1]) for node, values in both.items()}


def _mean(summaries: Sequence[Mapping[str, Any]], node: str) -> float:
    values = [(s["mae_K"][node], s["duration_s"]) for s in summaries if node in s["mae_K"]]
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
        value = f"{one['before']:.4g} -> {one['value']:.4g} {one['unit']}"
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
    yield f"{'before any':<28} {'':>10}   " + "  ".join(f"{found.unknown_K[i]:>5.1f} K" for i in least)
    for choice in found.choices:
        left = "  ".join(f"{choice.known_K[i]:>5.1f} K" for i in least)
        point = found.points[choice.test]
        yield f"{f'{point.name} ({point.kind})':<28} {choice.gain:>5.1f} nats   {left}"


def _checked(found: Protocol) -> Iterator[str]:
    errors = checked(found)
    width = max(len(words.name(node)) for node in errors)
    yield f"{'Mean error, drives':<{max(width, 20)}} {'before':>9} {'after':>9}"
    for node, (before, after) in sorted(errors.items(), key=lambda one: -one[1][0]):
        yield f"{words.name(node):<{max(width, 20)}} {words.kelvin(before):>9} {words.kelvin(after):>9}"


def filter_notes(found: Protocol) -> Iterator[str]:
    """A line a drive: what the filter makes of the channels that it was not given."""
    for summary in found.after:
        filtered = summary["filtered"]
        if filtered and filtered["mae_K"]:
            seen = {c["channel"]: c for c in summary["channels"]}
            parts = [
                f"{channel} {words.kelvin(mae)} (open loop {words.kelvin(seen[channel]['mae_K'])})"
                for channel, mae in filtered["mae_K"].items()
                if channel in seen
            ]
            if parts:
                yield (
                    f"{summary['session_name']}: from {words.counted(len(filtered['measured']), 'channel')} and an unknown "
                    f"heat at the {words.name(filtered['node'])}, the kept {words.joined(parts)}"
                )
