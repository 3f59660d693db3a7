"""What file and sessions themselves leave in doubt, in words: a file that is crude, sessions that contradict each
other, and what so few of them cannot say."""

from __future__ import annotations

from ingest.texts.times import clock
from replay.show.reports import verdict
from replay.show.words import words
from replay.studies.diagnosis.answer import Contradicting, Diagnosis, Named
from twin.diagnosis.crudeness import listed

ENOUGH = 3  # sessions: what fewer cannot say is told
UNLIKELY = 0.5  # what stands out with a crude file and is no more probable is rather what the file lacks


def told(diagnosis: Diagnosis) -> list[str]:
    """All that is in doubt, a sentence or two each."""
    return [*filter(None, [crude(diagnosis), not_judged(diagnosis)]), *contradictions(diagnosis)]


def contradictions(diagnosis: Diagnosis) -> list[str]:
    """A sentence for each two sessions and channel, the worst first."""
    return [_contradiction(diagnosis, one) for one in diagnosis.contradicting]


def _contradiction(diagnosis: Diagnosis, one: Contradicting) -> str:
    """ "1_s1 (0:40:00) and 3_s1 (0:40:00) ran alike at 6,000 rpm and at 100 A, but T_YOKE (yoke) reads 8.0 K less in
    the first, where 0.8 K (sd) is usual: ...", or "ran alike from the start on"."""
    first, second = (
        f"{verdict.session_name(diagnosis, session)} ({clock(t_s)})"
        for session, t_s in zip(one.sessions, one.t_s, strict=True)
    )
    place = words.where({name: [value, value] for name, value in one.at.items()}) if one.at else "from the start on"
    differ = f"{words.kelvin(abs(one.differ_K))} {'more' if one.differ_K > 0 else 'less'}"
    return (
        f"{first} and {second} ran alike {place}, but {one.channel} ({words.name(one.node)}) reads {differ} in the "
        f"first, where {words.kelvin(one.sd_K)} (sd) is usual: one recording is wrong, or the motor changed between "
        "them."
    )


def crude(diagnosis: Diagnosis) -> str:
    """How little it says that something stands out with a crude file, in two sentences; "" of a good one, and where
    nothing does or kept sessions confirm it."""
    if diagnosis.crudeness is None:
        return ""
    return (
        f"The file is crude: its numbers had to move {times(diagnosis.crudeness)} usual, also with what was found, as "
        "they do where a file of few parts lacks some. What was found may be that, and no kept session confirms it as "
        "a cause."
    )


def times(crudeness: float) -> str:
    """ "2.1 times as far as", or "further than" where no digit tells it from 1."""
    return "further than" if crudeness < 1.05 else f"{crudeness:.1f} times as far as"


def rather_lacking(diagnosis: Diagnosis, cause: Named | None = None) -> bool:
    """Whether what stands out, a cause or else a heat without a name, is rather something that a crude file lacks."""
    if diagnosis.crudeness is None:
        return False
    return (listed(diagnosis.crudeness) if cause is None else cause.probability) <= UNLIKELY


def not_judged(diagnosis: Diagnosis) -> str:
    """What fewer than three sessions cannot say, as one sentence; "" of more."""
    learnt, kept = len(diagnosis.train), len(diagnosis.held_out)
    if learnt + kept >= ENOUGH:
        return ""
    one = [
        "whether an offset is the sensor's, the coolant's or the start's",
        "what changes from session to session",
        "whether sessions contradict each other",
    ]
    two = ["which is wrong where the two disagree", "offsets that all sessions share"]
    none_kept = ["what the extended model gains"] * (not kept)
    said = words.joined([*(one if learnt == 1 else two), *none_kept])
    return f"{words.counted(learnt, 'session')} to learn from and {kept or 'none'} kept cannot say {said}."
