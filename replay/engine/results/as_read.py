"""Errors against readings as recorded, beside those against readings that the bench file corrects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ingest.catalogue.channels import ChannelData
from replay.engine.results.run import Observed
from replay.engine.results.summary import ChannelErrors


def with_errors_as_recorded(
    errors: Sequence[ChannelErrors], observed: Sequence[Observed], recorded: Sequence[ChannelData]
) -> list[ChannelErrors]:
    """The errors of a run's thermometers; of those whose values the bench file corrects also what the error is without
    that, and by how much the reading was moved. Stamps that were moved stay so."""
    corrected = {one.spec.name: one for one in recorded if one.read is not None}
    of = {one.channel: one for one in observed}
    return [
        _beside(one, of[one.channel], corrected[one.channel]) if one.channel in corrected else one for one in errors
    ]


def _beside(error: ChannelErrors, observed: Observed, channel: ChannelData) -> ChannelErrors:
    use, start = observed.usable, channel.t_ns[0]
    by = np.interp(observed.t_ns[use] - start, channel.t_ns - start, channel.value - channel.recorded)
    return replace(
        error,
        mae_recorded_K=float(np.abs(observed.residual[use] - by).mean()),
        reading_moved_K=float(by.mean()),
    )
