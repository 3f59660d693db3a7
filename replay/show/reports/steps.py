"""The chain of a diagnosis in words: a line a step, from the file as published to the last term."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from replay.show.words import words
from replay.studies.diagnosis.answer import ChainStep, Diagnosis

CALLED = {-1: "as published", 0: "recalibrated"}
JUDGES = {
    "evidence": "evidence alone decides on a term; how well each session is predicted from the others is only shown",
    "sessions left out": "what recalibration leaves is far above a lumped model's own error, so the file's form is "
    "wrong: a term is let in only where sessions predicted from the others ask for it too",
    "few sessions": "what recalibration leaves is far above a lumped model's own error, so the file's form is wrong; "
    "fewer than 4 sessions to learn from cannot be left out in turn, so one term alone is let in",
}


def told(diagnosis: Diagnosis) -> Iterator[str]:
    """Why terms were let in, and each step with its errors; nothing where evidence let none in."""
    if not diagnosis.chain or (diagnosis.judged_by == "evidence" and not diagnosis.causes):
        return
    yield JUDGES[diagnosis.judged_by]
    kept = any(step.kept_mae_K for step in diagnosis.chain)
    yield f"mean error over the nodes, each session as the others predict it{'; kept: of the kept sessions' * kept}"
    yield from (line(step) for step in diagnosis.chain)
    yield from _nearest([step for step in diagnosis.chain if step.kept_mae_K])


def _nearest(opened: Sequence[ChainStep]) -> Iterator[str]:
    """Where the errors of kept sessions stop falling, if that is before the last step."""
    nearest = min(opened, key=lambda step: mean_K(step.kept_mae_K), default=None)
    if nearest is not None and nearest is not opened[-1]:
        alone = f"; --steps {nearest.step} of whyhot accept takes no more than that" * (nearest.step > 0)
        yield f"nearest to the kept sessions: {called(nearest)}, {mean_K(nearest.kept_mae_K):.2f} K{alone}"


def line(step: ChainStep) -> str:
    """ "2 loss.winding.speed (ln BF 40): 0.98 K (winding 0.6, stator 0.7), 5 of 7 sessions better; kept 0.90 K"."""
    evidence = "" if step.log_bayes_factor is None else f" (ln BF {words.digits(step.log_bayes_factor)})"
    parts = [f"{called(step)}{evidence}: {_mean(step.left_out_mae_K)}"]
    parts += [f"{step.sessions_better} of {words.counted(step.sessions, 'session')} better"] * (step.step >= 0)
    kept = f"; kept {_mean(step.kept_mae_K)}" if step.kept_mae_K else ""
    return f"{', '.join(parts)}{kept}"


def called(step: ChainStep) -> str:
    """ "recalibrated", or the number and the id of the term."""
    return CALLED.get(step.step) or f"{step.step} {step.id}"


def mean_K(errors: Mapping[str, float]) -> float:
    """Mean over the nodes."""
    return sum(errors.values()) / len(errors)


def _mean(errors: Mapping[str, float]) -> str:
    nodes = ", ".join(f"{words.name(node)} {error:.1f}" for node, error in errors.items())
    return f"{mean_K(errors):.2f} K ({nodes})" if len(errors) < 5 else f"{mean_K(errors):.2f} K"
