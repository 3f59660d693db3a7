"""Where a ln BF comes from: a better fit, priors that no longer have to bend, and what one more term costs.

ln evidence = - (residuals + charges) / 2 - volumes / 2 by Laplace's approximation. Under the same noise and priors in
both fits the difference splits without a rest.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from twin.fitting.fit import Fit
from twin.fitting.model import Floats


@dataclass(frozen=True)
class EvidenceSplit:
    """ln BF = `fit` + the sum of `relieved` + `rest`. `fit`: half of what the weighted squared residuals fall by;
    `relieved` (p,): half of what each other parameter's (beta / sd)^2 falls by, in the order of the model without the
    term; `rest`: the term's own prior, how much narrower or wider all numbers have become, and what a search without
    the term that was cut short may still gain."""

    fit: float
    relieved: Floats
    rest: float

    @property
    def priors_relieved(self) -> float:
        """What the priors of all other parameters are relieved of together."""
        return float(self.relieved.sum())


def split(log_bayes_factor: float, found: Fit, without: Fit, place: int) -> EvidenceSplit:
    """What the ln BF of a term comes from: at `place` of the fit `found`, against the fit `without` it."""
    relieved = _charges(without) - np.delete(_charges(found), place)
    fit = _misfit(without) - _misfit(found)
    return EvidenceSplit(fit, relieved, log_bayes_factor - fit - float(relieved.sum()))


def _charges(found: Fit) -> Floats:
    """What the prior charges each parameter, in ln."""
    charged: Floats = (found.beta / found.model.sd) ** 2 / 2
    return charged


def _misfit(found: Fit) -> float:
    """What the residuals cost, in ln."""
    return found.cost - float(_charges(found).sum())
