"""How crude a motor file is: how far calibration had to move its numbers, over how far they usually are off.

The stated standard deviations of the healthy differences are those of motors whose files know all their parts. What a
file of few lumps lacks (a mass behind a lump, a path inside it, the place of a sensor in it) is not among them, so its
numbers go further to stand in for that, while what they leave of the readings is as small as ever. The root of their
mean square beyond what is stated is the Birge ratio of the priors (R. T. Birge, Phys. Rev. 40 (1932) 207,
doi:10.1103/PhysRev.40.207). What a name says follows from it: motors without any cause, whose numbers moved as
far, show candidates of a larger ln BF (an empirical null: B. Efron, J. Am. Stat. Assoc. 99 (2004) 96,
doi:10.1198/016214504000000089), so what stands out is the less often a cause.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from twin.fitting.actions import Parameter
from twin.fitting.fit import Fit

USUAL = 1.0  # a file that knows all parts of its motor stays below, whatever single cause of the library it hides
GROWS = 8.0  # by how many times what healthy motors show grows for each 1 beyond: from 12 in ln BF by some 100


def crudeness(found: Fit, stated: Sequence[Parameter]) -> float:
    """The root mean square of what the healthy differences moved in their `stated` sd, of those that every test shares,
    over the root of the share that is known of them by the data and by their family. They stand first in the vector of
    the fit."""
    here = slice(0, len(stated))
    shared = np.array([one.test is None for one in stated])
    variance = np.array([one.sd for one in stated]) ** 2
    known = 1 - np.minimum(found.covariance_diagonal[here] / variance, 1.0)
    return float(np.sqrt((found.beta[here] ** 2 / variance)[shared].sum() / known[shared].sum()))


def listed(crude: float) -> float:
    """How probable it is that what stands out with a file of this crudeness is in the list of candidates at all, and
    not what the file lacks."""
    return 1 / (1 + GROWS * max(0.0, crude - USUAL))
