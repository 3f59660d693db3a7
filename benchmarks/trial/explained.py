"""How much of a campaign a set of causes explains: what no search by evidence can go beyond, whatever it tries.

An effect that stands out in a motor that is healthy but for it (`benchmarks.trial.visibility`) need not do so beside
others: the more is wrong at once, the wider the campaign sets what a healthy motor may do, and the less each effect
adds. So the hidden effects are put into the model together, and its fit is held against that of the model without any,
as the fit with what was named is: each under the widths that it asks for, all under one noise.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from benchmarks.trial.cases import either_way
from twin.diagnosis.naming import Naming
from twin.diagnosis.refined import under_its_priors
from twin.differences.candidates import Candidate
from twin.differences.proposals import Proposals
from twin.errors import DivergedError
from twin.fitting.actions import Parameter
from twin.fitting.fit import NEAR_ENOUGH, Fit, fit
from twin.fitting.model import Model


def explained(
    naming: Naming, stated: Sequence[Parameter], candidates: Sequence[Candidate], causes: Sequence[str]
) -> tuple[float, float]:
    """ln evidence that the model gains by the hidden `causes` together, as far as they are candidates, and by what was
    named; `stated`: the healthy differences as the diagnosis begins with them."""
    base = naming.rounds[0].base
    proposals = Proposals(base.model, base.beta)
    hidden = [either_way(cause) for cause in causes]
    true = [proposals.parameter(c) for c in candidates if either_way(str(c.cause)) in hidden and not c.discrete]
    named = [refit.parameter for refit in naming.accepted]
    nothing, truth, answer = (_log_evidence(base, stated, candidates, own) for own in ([], true, named))
    return truth - nothing, answer - nothing


def _log_evidence(
    base: Fit, stated: Sequence[Parameter], candidates: Sequence[Candidate], own: Sequence[Parameter]
) -> float:
    """Of the model with its own parameters more, the better of two searches: from the file, and from the first fit."""
    model = Model(base.model.network, base.model.tests, (*stated, *own), base.model.noise)
    inside = [1e-3 * one.sd if one.low == 0.0 else 0.0 for one in own]
    found = [-np.inf]
    for start in (np.zeros(len(stated)), base.beta):
        try:
            first = fit(model, np.append(start, inside), NEAR_ENOUGH)
            found.append(under_its_priors(first, candidates, stated).log_evidence)
        except DivergedError:
            continue
    return max(found)
