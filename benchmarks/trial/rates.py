"""What trials add up to: rates by form, rule and visibility, many effects at once, lost causes, z of healthy motors."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Hashable, Iterable, Sequence
from itertools import pairwise
from typing import Any, TypeVar

import numpy as np

from benchmarks.shared import clopper_pearson
from benchmarks.trial.answers import VERDICTS, Result
from benchmarks.trial.audit import Spread, together
from benchmarks.trial.inside import MODELS
from benchmarks.trial.lost import NO_ANSWER, STEPS
from benchmarks.trial.visibility import BANDS, VISIBLE

BOTH_BOUNDS = 0.90  # of both together: each holds with 95 % by itself
K = TypeVar("K", bound=Hashable)
HIDES = ("one of the library", "one off the library", "several at once", "nothing")
STATED = (0.0, 0.5, 0.8, 0.95, 0.99, 1.0)  # edges of the stated probabilities that are counted together
ALL, NOT_RATED = "all", "not rated"  # of all forms and rules; of effects without an expected ln BF


def rate(k: int, n: int) -> dict[str, Any]:
    low, high = clopper_pearson(k, n, BOTH_BOUNDS) if n else (0.0, 1.0)
    return {"of": n, "count": k, "at_least": round(low, 3), "at_most": round(high, 3)}


def _by(results: Iterable[Result], key: Callable[[Result], K]) -> dict[K, list[Result]]:
    found: defaultdict[K, list[Result]] = defaultdict(list)
    for result in results:
        found[key(result)].append(result)
    return dict(found)


def motor_of(result: Result) -> str:
    """Form and rule."""
    return f"{result.case.form} {result.case.rule}"


# --- Single effects and healthy motors --------------------------------------------------------------------------------


def singles(results: Sequence[Result]) -> dict[str, dict[str, Any]]:
    """Form and rule -> rates of healthy motors, of effects by visibility, off the library and of exchanged channels;
    the worst first, then `all`."""
    chosen = [r for r in results if r.case.kind != "many"]
    rows = {name: _single(own) for name, own in _by(chosen, motor_of).items()}
    return dict(sorted(rows.items(), key=lambda row: _missed(row[1]), reverse=True)) | {ALL: _single(chosen)}


def _missed(row: dict[str, Any]) -> tuple[float, float]:
    """What makes a motor a bad one: the share of visible effects not told, then that of healthy motors called ill."""
    seen, ill = row["effects"][VISIBLE], row["healthy"]["named"]
    wrong = seen["first"]["of"] - seen["first"]["count"] - seen["class"]["count"]
    return wrong / max(seen["first"]["of"], 1), ill["count"] / max(ill["of"], 1)


def _single(results: Sequence[Result]) -> dict[str, Any]:
    healthy = [r for r in results if not r.hidden and not r.case.hidden]
    hidden = [r for r in results if r.hidden]
    outside = [r for r in hidden if r.hidden[0].cause.startswith("unknown.")]
    swaps = [r for r in hidden if ".swap_" in r.hidden[0].cause]
    inside = [r for r in hidden if r not in outside and r not in swaps]

    def counted(some: Sequence[Result]) -> dict[str, Any]:
        return {v: rate(sum(r.verdict == v for r in some), len(some)) for v in VERDICTS}

    def by_band(some: Sequence[Result]) -> dict[str, Any]:
        bands = {band: [r for r in some if r.hidden[0].band == band] for band in BANDS}
        return {band: counted(own) for band, own in bands.items()} | {
            NOT_RATED: counted([r for r in some if r.hidden[0].band is None])
        }

    return {
        "healthy": {
            "named": rate(sum(r.answer != "silent" for r in healthy), len(healthy)),
            "improved": rate(sum(r.improved for r in healthy), len(healthy)),
        },
        "effects": by_band(inside),
        "off library": by_band(outside),
        "swaps": counted(swaps),
        "wrong": rate(sum(r.verdict == "wrong" for r in inside), len(inside)),
        "no answer": sum(bool(r.failed) for r in results),
    }


def singles_table(rows: dict[str, dict[str, Any]]) -> list[str]:
    lines = []
    for motor, row in rows.items():
        lines += [f"{motor}: " + ", ".join(f"healthy {what} {_said(one)}" for what, one in row["healthy"].items())]
        lines += [f"  {'expected ln BF':<22}{'of':>4}" + "".join(f"{v:>18}" for v in VERDICTS)]
        kinds = {f"{kind} {band}": counts for kind in ("effects", "off library") for band, counts in row[kind].items()}
        for name, counts in (kinds | {"swaps": row["swaps"]}).items():
            if counts["first"]["of"] or (motor == ALL and NOT_RATED not in name):
                said = "".join(f"{_said(counts[v]):>18}" for v in VERDICTS)
                lines.append(f"  {name:<22}{counts['first']['of']:>4}{said}")
    wrong, lost = rows[ALL]["wrong"], rows[ALL]["no answer"]
    return [*lines, f"wrong names of all effects of the library: {_said(wrong)}; without an answer: {lost}"]


def _said(one: dict[str, Any]) -> str:
    return f"{one['count']}/{one['of']} [{one['at_least']:.0%}, {one['at_most']:.0%}]" if one["of"] else "-"


# --- Stated probabilities ---------------------------------------------------------------------------------------------


def stated_of(results: Sequence[Result]) -> list[tuple[float, bool]]:
    """Every name's stated probability, and whether it is true: what hides there is the name or in its class."""
    return [(p, r.of_name(name) in ("first", "class")) for r in results for name, p in r.stated.items()]


def reliability(stated: Sequence[tuple[float, bool]]) -> list[dict[str, Any]]:
    """Of the names whose stated probability lies between two of STATED: the mean of what is stated, and how many are
    true. Bins without a name are left out."""
    rows = []
    for low, high in pairwise(STATED):
        own = [(p, true) for p, true in stated if low <= p < high or p == high == STATED[-1]]
        if own:
            mean = float(np.mean([p for p, _ in own]))
            rows.append({"from": low, "to": high, "stated": mean, "true": rate(sum(true for _, true in own), len(own))})
    return rows


def by_what_hides(results: Sequence[Result]) -> dict[str, dict[str, Any]]:
    """What hides -> the mean of the stated probabilities of names there, and how many are true; kinds without a name
    are left out. The list of candidates, within which a probability is stated, has what hides in the first kind
    alone."""
    found: defaultdict[str, list[tuple[float, bool]]] = defaultdict(list)
    for result in results:
        found[_hides(result)] += stated_of([result])
    return {
        kind: {"stated": float(np.mean([p for p, _ in own])), "true": rate(sum(true for _, true in own), len(own))}
        for kind in HIDES
        if (own := found[kind])
    }


def _hides(result: Result) -> str:
    one, off, several, nothing = HIDES
    if len(result.hidden) > 1:
        return several
    if not result.hidden:
        return nothing
    return off if result.hidden[0].cause.startswith("unknown") else one


def by_what_hides_table(results: Sequence[Result]) -> list[str]:
    """Stated probabilities beside how often they were right, by what hides."""
    lines = [f"{'names where there hides':<30}{'mean':>8}{'true':>20}"]
    for kind, row in by_what_hides(results).items():
        lines.append(f"{kind:<30}{row['stated']:>8.3f}{_said(row['true']):>20}")
    return lines


def reliability_table(stated: Sequence[tuple[float, bool]]) -> list[str]:
    """Stated probabilities beside how often they were right; `off` where the bounds of that leave out their mean."""
    lines = [f"{'stated probability of a name':<30}{'mean':>8}{'true':>20}"]
    for row in reliability(stated):
        off = "" if row["true"]["at_least"] <= row["stated"] <= row["true"]["at_most"] else "  off"
        name = f"{row['from']:.2f} to {row['to']:.2f}"
        lines.append(f"{name:<30}{row['stated']:>8.3f}{_said(row['true']):>20}{off}")
    return lines


# --- Terms in the order of the search ---------------------------------------------------------------------------------


def by_entry(results: Sequence[Result]) -> dict[str, dict[str, Any]]:
    """Of campaigns with many effects, of the terms that entered first, second, ...: how many, and what they are of any
    hidden effect. A search that goes on too long has late terms that are seldom true."""
    rows: defaultdict[str, Counter[str]] = defaultdict(Counter)
    for result in results:
        if result.case.kind == "many":
            for place, name in enumerate(result.entered, 1):
                rows[f"{place}"][result.of_name(name)] += 1
    return {place: _true(rows[place]) for place in sorted(rows, key=int)}


def _true(verdicts: Counter[str]) -> dict[str, Any]:
    own = verdicts["first"] + verdicts["class"]
    return {"true": rate(own, verdicts.total()), "other law": verdicts["place"], "false": verdicts["wrong"]}


def by_entry_table(results: Sequence[Result]) -> list[str]:
    """A line for the terms that entered first, second, ..."""
    lines = [f"{'many at once, term that entered':<32}{'true':>20}{'other law':>12}{'false':>8}"]
    for place, row in by_entry(results).items():
        lines.append(f"{place:<32}{_said(row['true']):>20}{row['other law']:>12}{row['false']:>8}")
    return lines


# --- Many effects at once ---------------------------------------------------------------------------------------------


def many(results: Sequence[Result]) -> dict[str, dict[str, Any]]:
    """Form and rule -> what became of many effects at once, the worst first, then `all`."""
    chosen = [r for r in results if r.case.kind == "many"]
    rows = {name: _several(own) for name, own in _by(chosen, motor_of).items()}
    return dict(sorted(rows.items(), key=_untold, reverse=True)) | {ALL: _several(chosen)}


def _untold(row: tuple[str, dict[str, Any]]) -> float:
    """The share of visible effects that a form and rule leaves untold."""
    return float(1 - row[1]["visible told"] / row[1]["visible"]) if row[1]["visible"] else 0.0


def _several(results: Sequence[Result]) -> dict[str, Any]:
    names = Counter(r.of_name(name) for r in results for name in r.told)
    hidden = [(r, one) for r in results for one in r.hidden]
    visible = [(r, one) for r in results for one in r.visible]
    told = sum(r.is_told(one.cause) for r, one in hidden)
    return {
        "motors": len(results),
        "hidden": len(hidden),
        "named truly": told,
        "silent": len(hidden) - told,
        "visible": len(visible),
        "visible told": sum(r.is_told(one.cause) for r, one in visible),
        "other law": names["place"],
        "named falsely": names["wrong"],
        "no answer": sum(bool(r.failed) for r in results),
        "truth explains more": sum(r.is_missed for r in results),
        "sensors": _errors([r.sensors for r in results]),
        "nodes": _errors([r.nodes for r in results]),
    }


def _errors(errors: Sequence[Any]) -> dict[str, float | None]:
    """The mean of each model's error over the motors that have all of them [K]."""
    whole = [one for one in errors if one and None not in one.values()]
    return {model: float(np.mean([one[model] for one in whole])) if whole else None for model in MODELS}


COLUMNS = {  # of the table: what stands above, and what it counts
    "hidden": "hidden",
    "truly": "named truly",
    "silent": "silent",
    "visible": "visible",
    "told": "visible told",
    "law": "other law",
    "falsely": "named falsely",
    "failed": "no answer",
    "missed": "truth explains more",
}


def many_table(results: Sequence[Result]) -> list[str]:
    """One line for each motor, then one for each form and rule."""
    chosen = [r for r in results if r.case.kind == "many"]
    head = "".join(f"{name:>8}" for name in COLUMNS)
    lines = [f"{'many at once':<28}{head}  at kept sensors, at nodes without one: {' -> '.join(MODELS)} [K]"]
    rows = {f"{r.case.seed} {motor_of(r)}": _several([r]) for r in chosen} | many(results)
    for name, row in rows.items():
        counts = "".join(f"{row[count]:>8}" for count in COLUMNS.values())
        lines.append(f"{name:<28}{counts}  {_arrow(row['sensors'])}, {_arrow(row['nodes'])}")
    lines += ["ln evidence that all hidden effects together add, and what is named"]
    both = [(r.case.seed, r.truth, r.gained) for r in chosen if r.truth is not None and r.gained is not None]
    return lines + [f"  {seed:<26}{truth:>8.1f}{gained:>8.1f}" for seed, truth, gained in both]


def _arrow(errors: dict[str, float | None]) -> str:
    return " -> ".join("-" if errors[model] is None else f"{errors[model]:.2f}" for model in MODELS)


# --- What naming gains ------------------------------------------------------------------------------------------------


def gains(results: Sequence[Result]) -> dict[str, dict[str, Any]]:
    """Errors at kept sensors and at nodes without one, as mean over motors, and in how many of them the extended model
    has a smaller error than the recalibrated one: of all motors, of those where something is named, of these with a
    visible cause, and with kept sessions that got better."""
    rows = {}
    for kind in ("healthy", "single", "many"):
        every = [r for r in results if r.case.kind == kind]
        named = [r for r in every if r.named]
        rows[kind] = _gain(every)
        rows[f"{kind} named"] = _gain(named)
        rows[f"{kind} visible"] = _gain([r for r in named if r.visible])
        rows[f"{kind} improved"] = _gain([r for r in named if r.improved])
    return rows


def _gain(results: Sequence[Result]) -> dict[str, Any]:
    places = {"sensors": [r.sensors for r in results], "nodes": [r.nodes for r in results]}
    means = {where: _errors(errors) for where, errors in places.items()}
    better = {where: _better(errors) for where, errors in places.items()}
    return {"motors": len(results), **means, "better": better}


def _better(errors: Sequence[Any]) -> int:
    """In how many the extended model has the smaller error."""
    pairs = [(one["recalibrated"], one["extended"]) for one in errors if one]
    return sum(None not in pair and pair[1] < pair[0] for pair in pairs)


def gains_table(results: Sequence[Result]) -> list[str]:
    head = f"{'motors':>8}{'at kept sensors [K]':>24}{'better':>8}{'at nodes without one [K]':>28}{'better':>8}"
    lines = [f"{' -> '.join(MODELS):<40}{head}"]
    for name, row in gains(results).items():
        if not row["motors"]:
            continue
        sensors, nodes = (f"{_arrow(row[where]):>24}{row['better'][where]:>8}" for where in ("sensors", "nodes"))
        lines.append(f"{name:<40}{row['motors']:>8}{sensors}    {nodes}")
    return lines


# --- Lost causes and healthy motors' priors ---------------------------------------------------------------------------


def lost_causes(results: Sequence[Result]) -> dict[str, Counter[str]]:
    """Step -> the visible causes that it lost, and how often each."""
    found: defaultdict[str, Counter[str]] = defaultdict(Counter)
    for result in results:
        for one in result.visible:
            if result.failed:
                found[NO_ANSWER][one.cause] += 1
            elif one.cause in result.lost:
                found[result.lost[one.cause]][one.cause] += 1
    return {step: found[step] for step in STEPS if step in found}


def lost_table(results: Sequence[Result]) -> list[str]:
    total = sum(len(r.visible) for r in results)
    lines = [f"lost causes, of {total} with an expected ln BF of {VISIBLE}, by the step that lost them"]
    for step, causes in lost_causes(results).items():
        said = ", ".join(f"{cause} x{count}" if count > 1 else cause for cause, count in causes.most_common())
        lines.append(f"  {step:<16}{causes.total():>4}  {said}")
    return lines


def crudeness_table(results: Sequence[Result]) -> list[str]:
    """A line a motor, the crudest file last: the largest ln BF of a refitted candidate, and what is named."""
    lines = [f"{'how crude the file is':<28}{'hidden':>8}{'crudeness':>11}{'best ln BF':>12}  named"]
    for r in sorted((r for r in results if not r.failed), key=lambda r: r.crudeness):
        best = max(r.leading.values(), default=0.0)
        told = ", ".join(r.told) or "-"
        lines.append(f"{r.case.seed} {motor_of(r):<22}{len(r.hidden):>8}{r.crudeness:>11.2f}{best:>12.1f}  {told}")
    return lines


def beyond_usual_table(results: Sequence[Result]) -> list[str]:
    """A line a motor, the one with the number that moved furthest first: before any cause the ln evidence of its widest
    family, that number in stated sd, what hides and what is named."""
    lines = [f"{'how far beyond usual':<28}{'family':>8}{'number':>8}  whose; what hides; what is named"]
    for r in sorted((r for r in results if not r.failed), key=lambda r: -r.furthest):
        hides, told = (", ".join(names) or "-" for names in ([one.cause for one in r.hidden], r.told))
        figures = f"{r.widest:>8.1f}{r.furthest:>8.1f}"
        lines.append(f"{r.case.seed} {motor_of(r):<22}{figures}  {r.whose or '-'}; {hides}; {told}")
    return lines


def audits(results: Sequence[Result]) -> dict[str, dict[str, Spread]]:
    """Form -> family -> the spread of everyday parameters over its healthy motors, then over all forms."""
    healthy = [r for r in results if r.audit]
    found = {form: together(r.audit for r in own) for form, own in _by(healthy, lambda r: r.case.form).items()}
    return found | {ALL: together(r.audit for r in healthy)}


def audit_table(results: Sequence[Result]) -> list[str]:
    """Form by form, the families that are not as they should be first."""
    head = "".join(f"{name:>11}" for name in ("motors", "determined", "rms / root", "largest", "held in"))
    lines = [f"{'z of healthy motors':<36}{head}  whose is the largest"]
    for form, families in audits(results).items():
        for name, one in sorted(families.items(), key=lambda row: (not row[1].breaks, -row[1].determined)):
            ratio = "-" if one.ratio is None else f"{one.ratio:.2f}"
            held = f"{one.motors_held / one.motors:.0%}"
            cells = (one.motors, f"{one.determined:.1f}", ratio, f"{one.largest:.1f}", held)
            figures = "".join(f"{cell:>11}" for cell in cells)
            lines.append(f"{form + ' ' + name:<36}{figures}  {'; '.join([one.whose, *one.breaks])}")
    return lines
