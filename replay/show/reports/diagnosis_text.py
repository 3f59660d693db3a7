"""A diagnosis as text for the terminal and as Markdown for the viewer: the answer first, the next command last."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Sequence

from replay.show.reports import beyond_usual, doubts, kept_errors, sentences, steps, two_models, verdict
from replay.show.reports.verdict import Ending
from replay.show.words import words
from replay.show.words.terminal import labelled
from replay.studies.diagnosis.answer import Diagnosis, KeptGain, Named

RIVALS = 5  # told at most


def diagnosis_text(diagnosis: Diagnosis, planned: Sequence[str] = ()) -> str:
    """What `whyhot diagnose` prints, with paragraphs on what a plan promised. No colours, no trailing newline."""
    lines = labelled("Answer", sentences.headline(diagnosis))
    lines += labelled("What is wrong", verdict.what_is_wrong(diagnosis))
    lines += labelled("Left out", *(f"{m.session_name}: {m.says}" for m in diagnosis.masked))
    lines += labelled("Beyond usual", *beyond_usual.told(diagnosis))
    lines += labelled("Contradiction", *doubts.contradictions(diagnosis))
    lines += labelled("Not judged", *filter(None, [doubts.not_judged(diagnosis)]))
    lines += labelled("Crude file", *filter(None, [doubts.crude(diagnosis)]))
    for label, paragraphs in _ending(diagnosis):
        lines += labelled(label, *paragraphs)
    lines += labelled("Step by step", *steps.told(diagnosis))
    lines += labelled("Gain, kept", *_gain(diagnosis))
    lines += labelled("Two models", *two_models.notes(diagnosis), *two_models.paragraphs(diagnosis))
    lines += labelled("Planned", *planned)
    lines += labelled("Files", *filter(None, [sentences.no_files(diagnosis)]))
    lines += labelled("Looked at", looked_at(diagnosis))
    if diagnosis.next_test is not None:
        lines += labelled("Next test", diagnosis.next_test)
    commands = [*next_commands(diagnosis), f"whyhot report {diagnosis_name(diagnosis)}"]
    return "\n".join([*lines, *labelled("Next", " · ".join(commands))])


def looked_at(diagnosis: Diagnosis) -> str:
    """ "213 candidates, 5 sessions (3 to learn from, 2 kept), 68,000 steps"."""
    learnt, kept = len(diagnosis.train), len(diagnosis.held_out)
    sessions = f"{words.counted(learnt + kept, 'session')} ({learnt} to learn from, {kept} kept)"
    text = f"{diagnosis.candidates:,} candidates, {sessions}, {diagnosis.steps:,} steps"
    if diagnosis.dropped:
        text += f"; left out because the model became unstable with them: {', '.join(diagnosis.dropped)}"
    return text


def next_commands(diagnosis: Diagnosis) -> list[str]:
    """What to type next; the id as a person would type it."""
    name = diagnosis_name(diagnosis)
    seen = [*diagnosis.held_out_names, *diagnosis.train_names][:1]
    return [f"whyhot accept {name}"] * diagnosis.offers + [f"whyhot view {shlex.quote(session)}" for session in seen]


def diagnosis_name(diagnosis: Diagnosis) -> str:
    """ "d-7f31beef"."""
    return f"d-{words.short(diagnosis.diagnosis)}"


def answer_markdown(diagnosis: Diagnosis) -> str:
    """The answer for the viewer's text panel: what, how much, what else it could be, what it gains, where to look."""
    lines = [f"**{sentences.answer(diagnosis)}**", ""]
    unusual = list(beyond_usual.told(diagnosis))
    lines += ["**Beyond usual**", *(f"- {line}" for line in unusual), ""] if unusual else []
    for cause in diagnosis.causes:
        lines += [f"`{cause.id}`: {words.capital(cause.says)}.", ""]
        lines += [f"- {_evidence(diagnosis, cause)}", f"- {verdict.effect(diagnosis, cause)}"]
        lines += [f"- `{cause.formula}`", f"- {verdict.whether_improved(diagnosis, cause)}"]
        lines += [f"- not told apart from `{other}`: {says}" for other, says in verdict.rivals_left(cause)]
        lines += [f"- test that would: {cause.separating_test}"] if cause.separating_test else []
        lines += [""]
    gain = list(_gain(diagnosis))
    lines += ["**Gain on kept sessions**", *(f"- {line}" for line in gain), ""] if gain else []
    apart = two_models.paragraphs(diagnosis)
    lines += ["**Recalibrated or with the cause**", *(f"- {line}" for line in apart), ""] if apart else []
    lines += [f"Most telling test: {diagnosis.next_test}", ""] if diagnosis.next_test is not None else []
    return "\n".join([*lines, f"Diagnosis {diagnosis_name(diagnosis)}: {looked_at(diagnosis)}.", ""])


def _ending(diagnosis: Diagnosis) -> Iterator[tuple[str, Sequence[str]]]:
    """The middle of the page: label, paragraphs."""
    match verdict.ending(diagnosis):
        case Ending.NAMED | Ending.UNKNOWN:
            for cause in diagnosis.causes:
                yield from _cause(diagnosis, cause)
            if not diagnosis.causes:
                yield "Named cause", ["none"]
        case Ending.AGREES | Ending.CANNOT_TELL:
            yield "Named cause", ["none", sentences.details(diagnosis)]
    for heat in diagnosis.unknown:
        evidence = f"ln BF {words.digits(heat.log_bayes_factor)}{' of the strongest' * bool(heat.patchwork)}"
        told = [verdict.unknown_sentence(heat), verdict.goes_with(heat) + words.capital(evidence)]
        yield "Unknown", [*told, *filter(None, [words.capital(verdict.what_the_file_says(diagnosis, heat))])]
    yield "Rivals", [*_rivals(diagnosis)] or ["none above the null"]


def _cause(diagnosis: Diagnosis, cause: Named) -> Iterator[tuple[str, Sequence[str]]]:
    named = [f"{cause.id}   {_evidence(diagnosis, cause)}"]
    named += [f"of that ln BF {verdict.comes_from(cause.evidence)}"] if cause.evidence else []
    named += [cause.says, verdict.effect(diagnosis, cause)]
    named += [cause.formula] if cause.formula else []
    label = "Stands out" if doubts.rather_lacking(diagnosis, cause) else "Named cause"
    yield label, named if cause.improved else [*named, verdict.whether_improved(diagnosis, cause)]
    told = [f"{other}: {says}" for other, says in verdict.rivals_left(cause)]
    if told:
        share = f"its own share of that probability is {verdict.probability(cause.member_probability)}"
        test = [f"Test that would: {cause.separating_test}"] if cause.separating_test else []
        yield "Not told apart", [*told, share, *test]
    else:
        yield "Not told apart", [verdict.alone(cause)]


def _evidence(diagnosis: Diagnosis, cause: Named) -> str:
    bayes = f"ln BF {words.digits(cause.log_bayes_factor)}, {verdict.against(diagnosis)}"
    return f"probability {verdict.probability(cause.probability)} ({bayes})"


def _rivals(diagnosis: Diagnosis) -> Iterator[str]:
    for rival in verdict.rivals(diagnosis)[:RIVALS]:
        parts = f" ({verdict.fit_and_priors(rival.evidence)})" if rival.evidence else ""
        yield f"{rival.id}: ln BF {words.digits(rival.log_bayes_factor)}{parts}, {rival.why_not}"
    if len(diagnosis.rivals) > RIVALS:
        yield f"and {len(diagnosis.rivals) - RIVALS} more in the report"


def _gain(diagnosis: Diagnosis) -> Iterator[str]:
    """Errors on kept sessions, node by node, then what qualifies them."""
    if not diagnosis.gain:
        return
    gains, of = kept_errors.furthest_first(diagnosis.gain), kept_errors.stages(diagnosis.learnt)
    yield f"mean error {' -> '.join(kept_errors.STAGES[stage] for stage in of)}, {kept_errors.how(gains)}"
    if diagnosis.learnt:
        yield from _before_and_after(gains, of)
    else:
        yield " · ".join(_at(gain, of) for gain in gains)
    outside = f"{100 * max(g.outside_trained_share for g in gains):.0f}"
    points = (
        f"{outside} % of the time at operating points that were not"
        if outside != "0"
        else "at operating points that were"
    )
    interval = f"95 % intervals {gains[0].interval}; " if diagnosis.learnt else ""
    yield f"{words.joined(diagnosis.held_out_names)}; {interval}{points} learnt from"
    yield from gain_notes(diagnosis)


def _before_and_after(gains: Sequence[KeptGain], of: Sequence[str]) -> Iterator[str]:
    """The node that the answer tells first, then the better, the worse, those whose interval holds 0, and on one line
    those whose error stayed."""
    first, *others = gains
    stayed = [gain for gain in others if kept_errors.stayed(gain)]
    yield _at(first, of, _change(first))
    for word in ("better", "worse", "unchanged"):
        own = [gain for gain in others if kept_errors.change(gain) == word and gain not in stayed]
        yield from (_at(gain, of, _change(gain)) for gain in own)
    if stayed:
        yield f"unchanged by the cause: {' · '.join(_at(gain, of[-1:]) for gain in stayed)}"


def _change(gain: KeptGain) -> str:
    """ "0.2 better (0.1 to 0.4)": of the fitted errors with the cause, and its interval. "1.3 better, which may be
    chance (-0.4 to 3.0)" where that holds 0."""
    change, ends = kept_errors.change(gain), sorted(gain.ci95_K)
    if kept_errors.stayed(gain):
        return "unchanged by the cause"
    word = "better" if gain.mae_before_K > gain.mae_after_K else "worse"
    low, high = ends if word == "better" else (-ends[1], -ends[0])
    chance = ", which may be chance" if change == "unchanged" else ""
    at = " to ".join(words.signed(end).removeprefix("+") for end in (low, high))
    change_K, _ = words.figures([abs(gain.mae_before_K - gain.mae_after_K), 0.0])
    return f"{change_K} {word}{chance} ({at})"


def _at(gain: KeptGain, of: Sequence[str], *more: str) -> str:
    return f"{words.name(gain.node)} {kept_errors.errors(gain, of, *more, kept_errors.moved(gain))}"


def gain_notes(diagnosis: Diagnosis) -> list[str]:
    """What a reader must know before trusting the gain."""
    notes = []
    if diagnosis.log_score_gain is not None and diagnosis.log_score_gain_lower is not None:
        gain, least = diagnosis.log_score_gain, diagnosis.log_score_gain_lower
        more, higher = ("more", "higher") if gain >= 0 else ("less", "lower")
        score, lower = words.digits(abs(gain)), words.digits(least if gain >= 0 else -least)
        bound = "at least" if gain >= 0 else "at most"
        notes.append(
            f"kept sessions are {more} probable with the cause: log score, fitted, {score} {higher}, {bound} {lower}"
        )
    if diagnosis.few_kept_data:
        notes.append("few kept data: under 8 independent blocks, so the intervals are rough")
    if diagnosis.opened_before:
        notes.append("not a first look: an earlier diagnosis opened these kept sessions")
    return notes
