"""What a campaign could find and the next bench day, as JSON and as text as wide as the terminal."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Iterator
from typing import Any

from ingest.catalogue.page import table
from ingest.texts.units import as_written
from replay.show.words import words
from replay.show.words.terminal import labelled
from replay.show.words.width import width
from replay.studies.planning.plan import Planned
from twin.diagnosis.told_apart import STANDS_OUT
from twin.diagnosis.two_models import HOTTER_K
from twin.differences.proposals import at_one
from twin.motor.outputs import BLOCK_S
from twin.planning.chain import Best
from twin.planning.detectable import Detectable

UNMEASURED = (
    "nothing was measured yet: what a healthy motor may do is as wide as the motor file says, noise as wide as before "
    "any data. Readings make both narrower: plan again with --sessions once there are some."
)
HIDDEN = 10  # causes that are printed; all are in the JSON


def document(found: Planned) -> dict[str, Any]:
    """`whyhot.plan/1`."""
    day, ids = found.day, [str(candidate.cause) for candidate in found.prospect.candidates]
    promise = day.promise
    each = (promise.before, promise.after, promise.all_observed, promise.since_before)
    before, after, everything, since = (dict(zip(ids, d.tolist(), strict=True)) for d in each)
    tests, observed = (dict(zip(ids, _best(best), strict=True)) for best in (promise.best_test, promise.best_observed))
    usual = {one.name: one.sd / at_one(one) for one in found.prospect.ground.candidates}
    node, hottest, high = _hottest(found)
    return {
        "schema": "whyhot.plan/1",
        "motor": found.network.name,
        "model": found.model,
        "sessions": [session.session for session in found.sessions],
        "not_run": list(found.listed),
        "stands_out_d": STANDS_OUT,
        "candidates": [
            {
                "id": str(one.candidate.cause),
                "smallest": one.smallest,
                "unit": one.unit,
                "times_usual": one.times if one.smallest is not None else None,
                "hot_spot_K": one.hot_spot_K,
                "indistinguishable_from": list(one.alike),
                "usual_amplitude": usual[str(one.candidate.cause)],
                "usual_d": before[str(one.candidate.cause)],
                "usual_d_after": after[str(one.candidate.cause)],
                "best_test": tests[str(one.candidate.cause)],
                "best_observation": observed[str(one.candidate.cause)],
                "usual_d_all_observed": everything[str(one.candidate.cause)],
                "usual_d_since_before": since[str(one.candidate.cause)],
            }
            for one in found.prospect.detectable
        ],
        "chain": [
            {"step": number, "test": step.proposed.words, "hours": step.hours, "gain_nat": step.gain_nat}
            for number, step in enumerate(day.steps, 1)
        ],
        "observe": [{"what": step.what, "node": step.node, "gain_nat": step.gain_nat} for step in day.observed],
        "day": {
            "hours": _hours(found),
            "rest_min": day.rest_min,
            "hottest_node": node,
            "hottest_degC": hottest,
            "hottest_high_degC": high,
            "limits": "motor file" if found.prospect.limits.stated else "as hot as recorded",
        },
        "tests_weighed": day.weighed,
        "cannot_be_run": [{"test": test, "why": why} for test, why in day.refused],
    }


def _best(best: Best) -> list[dict[str, Any] | None]:
    """What shows each candidate best, and d of its usual size then; None where nothing shows it better."""
    pairs = zip(best.what, best.d.tolist(), strict=True)
    return [{"what": what, "usual_d": d} if what else None for what, d in pairs]


def plan_text(found: Planned, onward: str) -> str:
    """What `whyhot plan` prints, `onward` as its next command. No colours, no trailing newline."""
    lines = labelled("Answer", answer(found))
    if found.listed:
        lines += labelled("Not run", UNMEASURED)
    lines += ["", *_hidden(found), "", *_chain(found)]
    lines += ["", *labelled("Heat", _heat(found))]
    if found.day.observed:
        told = [f"{words.name(step.what)} ({step.gain_nat:.3f})" for step in found.day.observed]
        lines += labelled("Observe", f"what would add most to this day [nat], the best first: {words.joined(told)}")
    if found.day.refused:
        count, (test, why) = len(found.day.refused), found.day.refused[0]
        lines += labelled("Cannot be run", f"{words.counted(count, 'more test')}, such as {test}: {why}")
    return "\n".join([*lines, "", f"next: {onward}"])


def answer(found: Planned) -> str:
    """How many causes would show at their usual size now and after the day, and the first test of it."""
    promise, total = found.day.promise, len(found.prospect.candidates)
    now, then = (int((d >= STANDS_OUT).sum()) for d in (promise.before, promise.after))
    return (
        f"Of {total} candidate causes {now} would show at their usual size in {_these(found)}, {then} after a bench "
        f"day of {_hours(found):.1f} h. First: {found.day.steps[0].proposed.words}."
    )


def _these(found: Planned) -> str:
    what, count = ("test", len(found.listed)) if found.listed else ("session", len(found.sessions))
    return f"this {what}" if count == 1 else f"these {count} {what}s"


def _hours(found: Planned) -> float:
    return len(found.day.course.speed) * BLOCK_S / 3600


def _hidden(found: Planned) -> Iterator[str]:
    """The causes that would stay silent at their usual size and heat most then, one of each that look alike."""
    silent = [one for one in found.prospect.detectable if not one.usual_shows and one.hot_spot_K is not None]
    silent.sort(key=lambda one: -_usual_K(one))
    shown: list[Detectable] = []
    for one in silent:
        if not any(str(one.candidate.cause) in other.alike for other in shown):
            shown.append(one)
    shown = shown[:HIDDEN]
    if not shown:
        yield "No cause of its usual size stays silent."
        return
    head = ("May hide, and heat the hot spot by", "at usual size", "shows from", "at that size")
    names, *lines = table(head, map(_hidden_row, shown), width(), right=(1, 2, 3))
    yield names
    for i, line in enumerate(lines):
        yield line
        if i < len(shown) and shown[i].alike:
            yield from looks_like(shown[i])


def looks_like(one: Detectable) -> list[str]:
    """The causes that it cannot be told from, each name whole on its line."""
    also = f"also looks like {words.joined(one.alike[:2])}"
    return textwrap.wrap(also, width(), initial_indent="  ", subsequent_indent="  ", break_on_hyphens=False)


def _hidden_row(one: Detectable) -> tuple[str, ...]:
    return str(one.candidate.cause), words.kelvin(_usual_K(one)), shows_from(one), words.kelvin(one.hot_spot_K or 0.0)


def shows_from(one: Detectable) -> str:
    """The smallest size that shows: "24 W/K", "factor 2.2" of a capacity, "3.1 %" of another share."""
    smallest = one.smallest or 0.0
    if one.unit != "1":
        return f"{words.number(smallest)} {as_written(one.unit)}"
    if one.candidate.cause.law == "scale":  # its logarithm is what is sought
        return f"factor {words.digits(math.exp(smallest), 2)}"
    return f"{words.digits(100 * smallest, 2)} %"


def _usual_K(one: Detectable) -> float:
    """What the usual size of a cause heats the hot spot by [K]."""
    return (one.hot_spot_K or 0.0) / one.times


def _chain(found: Planned) -> Iterator[str]:
    weighed = words.counted(found.day.weighed, "test")
    head = f"The next bench day, the best of {weighed}: what each adds to what is known [nat], hours with its rest"
    yield from textwrap.wrap(head, width())
    for number, step in enumerate(found.day.steps, 1):
        head = f"{number}  {step.gain_nat:.3f}  {step.hours:.1f} h  {step.proposed.words}"
        yield from textwrap.wrap(head, width(), subsequent_indent=" " * 15)


def _heat(found: Planned) -> str:
    node, hottest, high = _hottest(found)
    of = "its limit" if found.prospect.limits.stated else f"its hottest so far plus {HOTTER_K:.0f} K"
    return (
        f"the {words.name(node)} comes nearest to {of}: {hottest:.0f} °C, at most {high:.0f} °C (95 %), with "
        f"{found.day.rest_min} min of rest after each test; the plan believes its motor file"
    )


def _hottest(found: Planned) -> tuple[str, float, float]:
    """The node that comes nearest to its limit, how hot it is then, and the upper end of the band [degC]."""
    hot = found.day.heated
    room = hot.high - hot.limits.degC
    block, place = divmod(int(room.argmax()), room.shape[1])
    return hot.limits.nodes[place], float(hot.degC[block, place]), float(hot.high[block, place])
