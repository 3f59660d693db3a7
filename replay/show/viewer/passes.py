"""A session cut into what it repeats: passes of a driving cycle, pulses of load, heatings of an oven."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from ingest.catalogue.channels import ChannelData
from ingest.catalogue.kinds import repeats
from replay.errors import ViewerError
from replay.show.viewer.seen import SessionSeen

OVEN = "ageing"  # the kind of session that an oven heats


def passes(seen: SessionSeen) -> list[SessionSeen]:
    """Each pass as a session of its own, "3_wltp_cycle_2", with its part of the replays. Raises ViewerError where the
    session repeats nothing."""
    session = seen.session
    found = _heatings(seen.channels) if session.kind == OVEN else repeats(seen.channels)
    if len(found) < 2:
        raise ViewerError(
            f"--align cycle: {session.name} ({session.kind}) repeats nothing: cycles are passes of the WLTC, pulses of "
            "load with rests between, and heatings of an oven. --align start lays whole sessions over one another."
        )
    return [_part(seen, number, *span) for number, span in enumerate(found, 1)]


def _part(seen: SessionSeen, number: int, begin_ns: int, end_ns: int) -> SessionSeen:
    session = seen.session
    channels = [one.samples(slice(*np.searchsorted(one.t_ns, [begin_ns, end_ns]).tolist())) for one in seen.channels]
    runs = {role: run.between(begin_ns, end_ns) for role, run in seen.runs.items()}
    own = replace(session, name=f"{session.name}_cycle_{number}", start_ns=begin_ns, end_ns=end_ns)
    return replace(seen, session=own, channels=channels, runs=runs)


def _heatings(channels: Sequence[ChannelData]) -> list[tuple[int, int]]:
    """(begin, end) [ns] of each stay above the middle of the hottest channel's course, from where its heating began to
    where the next one does."""
    from analytics.insulation.dose.oven_cycle import FALLEN_K, cycles

    courses = [one for one in channels if one.spec.quantity == "temperature" and len(one.t_ns)]
    if not courses:
        return []
    hottest = max(courses, key=lambda one: float(one.value.max()))
    low, high = float(hottest.value.min()), float(hottest.value.max())
    if high - low < 2 * FALLEN_K:
        return []
    stays = cycles((hottest.t_ns - hottest.t_ns[0]) / 1e9, hottest.value, (low + high) / 2)
    begins = [int(hottest.t_ns[0] + 1e9 * (stay.heating_from_s or 0.0)) for stay in stays]
    return list(pairwise([*begins, int(hottest.t_ns[-1]) + 1]))
