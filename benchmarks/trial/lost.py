"""At which step of a diagnosis a true cause was lost: read from the naming itself."""

from __future__ import annotations

from benchmarks.trial.cases import either_way
from replay.studies.diagnosis.search import Found
from twin.diagnosis.naming import Naming
from twin.diagnosis.rounds import Refit
from twin.differences.candidates import Candidate

NOT_PROPOSED = "not proposed"  # no candidate says this
EXCHANGE = "no exchange"  # the scan for exchanged channels did not find it
UNKNOWN = "unknown instead"  # a heat of any course beat every candidate before any refit
SCREENED = "linear score"  # too low to be refitted, though nothing else was named before
RAN_AWAY = "ran away"  # the model diverges with it
IMPOSSIBLE = "impossible"  # above the threshold, but it takes away more than there is, or moves hardly anything
WEAK = "after refit"  # refitted, and not above the threshold or what chance gives
OTHER_FIRST = "other first"  # above the threshold, but another came first and left too little of it
LEFT_OUT = "left out"  # entered, and went when each was left out once
PATCHWORK = "patchwork"  # survived only together with others
KEPT = "kept sessions"  # named, and refused by the sessions not learnt from
NO_ANSWER = "no answer"  # the diagnosis ended in an error
NOT_UNKNOWN = "not unknown"  # off the library, and no unknown heat was told
STEPS = (
    *(NOT_PROPOSED, EXCHANGE, UNKNOWN, SCREENED, RAN_AWAY, IMPOSSIBLE, WEAK, OTHER_FIRST, LEFT_OUT, PATCHWORK, KEPT),
    *(NO_ANSWER, NOT_UNKNOWN),
)


def lost_at(found: Found, cause: str, candidates: tuple[Candidate, ...]) -> str:
    """The step that lost a cause which is not in the answer: the last that it came to."""
    if cause.startswith("unknown."):
        return NOT_UNKNOWN
    naming, wanted = found.naming, either_way(cause)
    proposed = [c for c in candidates if either_way(str(c.cause)) == wanted]
    if not proposed:
        return NOT_PROPOSED
    if proposed[0].discrete:
        return EXCHANGE
    if proposed[0] in [refit.candidate for refit, _ in found.refused]:
        return KEPT
    if proposed[0] in [refit.candidate for refit in naming.patchwork]:
        return PATCHWORK
    if proposed[0] in [candidate for candidate, _ in naming.left_out]:
        return LEFT_OUT
    if naming.is_unknown:
        return UNKNOWN
    return _in_the_search(naming, proposed[0])


def _in_the_search(naming: Naming, candidate: Candidate) -> str:
    refits = [refit for found in naming.rounds for refit in found.refits if refit.candidate == candidate]
    strong = [refit for refit in refits if refit.log_bayes_factor > naming.threshold]
    if strong:
        return OTHER_FIRST if any(refit.nameable for refit in strong) else IMPOSSIBLE
    if any(str(candidate.cause) in found.dropped for found in naming.rounds):
        return RAN_AWAY
    if _linear(naming, candidate) > naming.threshold and _was_beaten(naming, refits):
        return OTHER_FIRST
    return WEAK if refits else SCREENED


def _linear(naming: Naming, candidate: Candidate) -> float:
    """Its score in the first round."""
    first = naming.rounds[0]
    at = [i for i, one in enumerate(first.candidates) if one == candidate]
    return float(first.scores.log_bayes_factor[at[0]]) if at else 0.0


def _was_beaten(naming: Naming, refits: list[Refit]) -> bool:
    """Whether another cause entered before it was ever refitted in the first round."""
    return len(naming.rounds) > 1 and not any(refit in naming.rounds[0].refits for refit in refits)
