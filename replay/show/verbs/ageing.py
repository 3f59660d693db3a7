"""What heat has done to the insulation, as text as wide as the terminal."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

from ingest.catalogue.page import table
from replay.show.words import words
from replay.show.words.courses import FORMS, form, in_brief
from replay.show.words.terminal import labelled
from replay.show.words.width import width
from replay.studies.ageing.assessment import AgeingLaw, Assessment, Batch, FleetCounts, LivesLaw, Specimen, StressEffect
from replay.studies.ageing.whole import rank

ROWS = 12  # specimens or batches in a table; of more, those that stand out most
NAMED = 8  # specimens or batches in a sentence
TOO_FEW = "too few checks for a course"


def ageing_text(found: Assessment, kept: bool = True) -> str:
    """What `whyhot ageing` prints. No colours, no trailing newline. `kept`: whether it is in the store, for SQL."""
    lines = labelled("Answer", answer(found))
    lines += ["", *_table(found)]
    if len(found.batches) > 1:
        lines += ["", *_batches(found)]
    lines.append("")
    for name, text in says(found):
        lines += labelled(name, text)
    page = f" LIMIT {ROWS} OFFSET {ROWS}" if found.whole.specimens > ROWS else ""
    if kept:
        lines += labelled("Next", f'whyhot sql "FROM conductivity_by_cycle" · whyhot sql "FROM fleet_health{page}"')
    return "\n".join(lines)


def says(found: Assessment) -> list[tuple[str, str]]:
    """Name and text of all that the answer rests on: repeatability, rules, law, lives, other stresses."""
    rules = f"what an hour at another temperature is worth: {words.joined(found.rules)}; a range spans what they give"
    size = "thermal resistance of the insulation; percent per 100 h are 100 times the slope of ln R, in brackets 95 %"
    fleet = any(one.fleet_slope_percent_per_100h is not None and not one.significant for one in found.specimens)
    size += ", where no change is seen, of these checks and the fleet together" * fleet
    parts = [("R", f"{size}; repeatability {found.repeatability_from}"), ("Rules", rules)]
    parts += [("Law", _law(found.law))] if found.law else []
    parts += [("Life", _lives(found.life.law, found.criterion))] if found.life.law else []
    parts += [("Stress", text) for text in _stress(found)]
    return [*parts, ("Life used", f"what the dose is worth at {found.threshold_degC:g} °C, as a share of 20,000 h")]


def answer(found: Assessment) -> str:
    """How many specimens, what the courses are, and what stands out."""
    whole = found.whole
    parts = [f"{words.counted(whole.specimens, 'specimen')}, {words.counted(whole.checks, 'check')}."]
    if whole.specimens <= NAMED:
        changed = [one for one in found.specimens if one.significant]
        parts += [f"{one.specimen}: R {course(one)}." for one in changed]
        same = [one.specimen for one in found.specimens if not one.significant and one.fitted]
        few = [one.specimen for one in found.specimens if one.checks and not one.fitted]
        unseen = [one.specimen for one in found.specimens if not one.checks]
        told = {FORMS["none"]: same, TOO_FEW: few, "no check": unseen}
        parts += [f"{words.joined(names)}: {says}." for says, names in told.items() if names]
    else:
        counts = words.joined([f"in {count:,} R {FORMS[name]}" for name, count in whole.changed.items()])
        parts.append(f"{how_many_change(whole)} beyond repeatability" + (f" ({counts})." if counts else "."))
    return " ".join([*parts, standing_out(found)])


def how_many_change(whole: FleetCounts) -> str:
    """How many specimens change, and of how many, in words."""
    many = sum(whole.changed.values())
    does = "changes" if many == 1 else "change"
    if whole.weighed == whole.specimens:
        return f"{many:,} of {whole.specimens:,} {does}"
    return f"{many:,} of {whole.weighed:,} that were drawn by chance {does}"


def course(one: Specimen) -> str:
    """What the R of one specimen does, in words; its slope where that goes beyond repeatability."""
    if one.fitted is None:
        return TOO_FEW if one.checks else "no check"
    text = form(one)
    if one.change_at_dose_h is not None:
        at = f"{one.change_at_dose_h:.0f} h"
        text += f" from {at} on" if one.form == "dip_then_rise" else f" at {at}"
    if one.level_from_dose_h is not None:
        text += f" until it is level from {one.level_from_dose_h:.0f} h on"
    if one.slope_percent_per_100h is not None and one.significant:
        band = f" ({one.ci95[0]:.1f} to {one.ci95[1]:.1f})" if one.ci95 else ""
        text += f", {one.slope_percent_per_100h:+.1f} % per 100 h{band}".replace("-", "−")
    return f"{text} (probability of this form {100 * one.form_probability:.0f} %)"


def standing_out(found: Assessment) -> str:
    """The batches and specimens that are not as the others."""
    batches = [f"batch {one.batch}" for one in sorted(found.batches, key=score) if one.outlying]
    specimens = [one.specimen for one in sorted(found.specimens, key=score) if one.outlying]
    rate = f"false discovery rate {100 * found.false_discovery_rate:.0f} %"
    listed = ((batches, len(batches)), (specimens, found.whole.outlying))
    said = [_first(names, of) for names, of in listed if names]
    scores = [batch.score for batch in found.batches] + [one.score for one in found.specimens]
    if not said and scores.count(None) == len(scores):
        return "There are too few specimens to tell whether one stands out."
    if not said:
        return f"None stands out from the others ({rate})."
    return f"Not as the others: {words.joined(said)} ({rate})."


def _first(names: Sequence[str], of: int) -> str:
    more = f" and {of - NAMED:,} more" if of > NAMED else ""
    return f"{words.joined(names[:NAMED])}{more}"


def score(one: Specimen | Batch) -> float:
    """The one that ages fastest beyond the others first."""
    return math.inf if one.score is None else -one.score


def _table(found: Assessment) -> Iterator[str]:
    shown = list(found.specimens)
    if len(shown) > ROWS:
        place = rank({one.batch for one in found.batches if one.outlying})
        shown = sorted(shown, key=lambda one: place(one.outlying, one.batch, one.score))[:ROWS]
    head = ("Specimen", "batch", "checks", "dose", "course", "sure", "R per 100 h", "conducts", "life used", "")
    rows = [head, *map(_specimen_row, shown)]
    if all(one.batch is None for one in shown):
        rows = [(name, *rest) for name, _, *rest in rows]
    whole = range(rows[0].index("checks"), len(head) - 1)  # a course of which the end is cut is another
    yield from table(rows[0], rows[1:], width(), right=whole)
    if found.whole.specimens > len(shown):
        yield f"and {found.whole.specimens - len(shown):,} more"


def _specimen_row(one: Specimen) -> tuple[str, ...]:
    last = next((check for check in reversed(one.checks) if check.conductivity_percent is not None), None)
    said = (in_brief(one), f"{100 * one.form_probability:.0f} %") if one.fitted else ("-", "-")
    course = (*said, slope(one))
    left = (_percent(last.conductivity_percent if last else None), life_used(one), _apart(one))
    return one.specimen, one.batch or "-", str(len(one.checks)), hours(one.dose_h), *course, *left


def _apart(one: Specimen) -> str:
    if not one.outlying:
        return ""
    return "stands out" if one.score is None else f"stands out ({one.score:+.2g} sd)".replace("-", "−")


def _batches(found: Assessment) -> Iterator[str]:
    head = ("Batch", "specimens", "R per 100 h", "above the others", "")
    yield from table(head, map(_batch_row, sorted(found.batches, key=score)[:ROWS]), width(), right=(1, 2, 3))
    if len(found.batches) > ROWS:
        yield f"and {len(found.batches) - ROWS} more"


def _batch_row(one: Batch) -> tuple[str, ...]:
    above = "-" if one.score is None else f"{words.signed(one.score)} sd"
    figures = (str(one.specimens), _percent_per_100h(one.slope_percent_per_100h), above)
    return one.batch, *figures, "stands out" if one.outlying else ""


def _law(law: AgeingLaw) -> str:
    begins = f" from {law.from_h:.0f} h on" if law.from_h else ""
    much = "less" if law.percent_per_100h < 0 else "more"
    whose, spread = ("the fleet", "specimens differ by") if law.source == "fleet" else (law.source, "sd")
    size = f"{abs(law.percent_per_100h):.1f} % {much} each 100 h{begins} ({spread} {law.sd:.1f} %)"
    text = f"insulation conducts {size}, from {whose}"
    return f"{text}; written into model {words.short(law.model)}: replay takes it into account" if law.model else text


def _lives(law: LivesLaw, criterion: str) -> str:
    def with_band(given: dict[str, Any], digits: int) -> str:
        ends = ["?" if end is None else f"{end:,.{digits}f}" for end in given["ci95"]]
        return f"{given['value']:,.{digits}f} ({ends[0]} to {ends[1]})"

    hours, energy = with_band(law.median_h_at_180degC, 0), with_band(law.activation_energy_eV, 2)
    half = f"half of the specimens reach {criterion} by".replace("-", "−")
    text = f"{half} {hours} h at 180 °C, with {energy} eV, in brackets 95 %"
    if law.temperature_index_degC is None or law.halving_interval_K is None:
        return f"{text}; {law.why_no_index}"
    index, halving = with_band(law.temperature_index_degC, 0), with_band(law.halving_interval_K, 1)
    return f"{text}; temperature index {index} °C, halving interval {halving} K"


def _stress(found: Assessment) -> Iterator[str]:
    """The stresses that are told from all others, then those that go together."""
    known = [one for one in found.stress if one.percent is not None and one.sd_percent is not None]
    if len(known) < 2:
        return
    told = [f"{_effect(one)} ({one.name})" for one in known if not one.not_told_from]
    if told:
        yield f"{words.joined(told)}, all specimens together"
    together = [one for one in known if one.not_told_from]
    if together:
        names, alone = words.joined([one.name for one in together]), " or ".join(map(_effect, together))
        yield (
            f"{names} cannot be told apart here: {alone}, if one alone did it, all specimens together; "
            "cycles of several lengths in one specimen would tell"
        )


def _effect(one: StressEffect) -> str:
    return f"R {one.percent:+.1f} % ± {one.sd_percent:.1f} % each {one.unit}".replace("-", "−").replace("degC", "°C")


def hours(value: float | None) -> str:
    return "-" if value is None else f"{value:,.0f} h"


def slope(one: Specimen) -> str:
    """The slope of a specimen: its own where its course is beyond repeatability, else that of it and its fleet."""
    own, fleet = one.slope_percent_per_100h, one.fleet_slope_percent_per_100h
    return _percent_per_100h(own if one.significant or fleet is None else fleet)


def _percent_per_100h(slope: float | None) -> str:
    return "-" if slope is None else f"{words.signed(slope)} %"


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{value:.0f} %"


def life_used(one: Specimen) -> str:
    if one.life_used is None:
        return "-"
    return f"{100 * one.life_used[0]:.0f} to {100 * one.life_used[1]:.0f} %"
