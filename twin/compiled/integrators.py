"""Time integrators as tables: singly diagonally implicit Runge-Kutta methods and BDF2, one factorisation a step.

Within a step the inputs are held, so the network is `C dT/dt = c - L T`, linear (terms that are not are linearised
about the temperature at the start of the step, which keeps second order: a Rosenbrock method). Stage i of a method
with Butcher tableau `a`, diagonal gamma, then is one solve with the same matrix:

    base_i = T0 + sum_{j<i} (a_ij / gamma) delta_j
    (C / (gamma h) + L) Y_i = (C / (gamma h)) base_i + c
    delta_i = Y_i - base_i

and the step ends at `T1 = T0 + sum_i (b_i / gamma) delta_i`, which is Y_s where the last row of `a` is `b` (stiffly
accurate). A method that looks back has T0 + back (T0 - T_before) in place of T0; its first step, which has nothing
behind it, is one of implicit Euler (gamma 1, back 0).
"""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Tableau:
    """A singly diagonally implicit method: `a` strictly below the diagonal (row i has i entries), weights `b`.

    `step_s`: the step [s] at which its error was measured to be small enough. `back`: the share of
    the last step's change that the next step begins with.
    """

    name: str
    order: int
    gamma: float
    a: tuple[tuple[float, ...], ...]
    b: tuple[float, ...]
    step_s: float
    source: str
    back: float = 0.0

    @property
    def stiffly_accurate(self) -> bool:
        return self.b == (*self.a[-1], self.gamma)


_GAMMA2 = 1 - 1 / math.sqrt(2)

SDIRK2 = Tableau(
    name="sdirk2",
    order=2,
    gamma=_GAMMA2,
    a=((), (1 - _GAMMA2,)),
    b=(1 - _GAMMA2, _GAMMA2),
    step_s=0.5,
    source="R. Alexander, SIAM J. Numer. Anal. 14 (1977), doi:10.1137/0714068; L-stable",
)

BDF2 = Tableau(
    name="bdf2",
    order=2,
    gamma=2 / 3,
    a=((),),
    b=(2 / 3,),
    step_s=0.5,
    source="the paper's: C (3 T1 - 4 T0 + T_before) / (2 h) = q(T1); Hairer and Wanner, Solving Ordinary Differential "
    "Equations II, V.1; loses its order where inputs jump",
    back=1 / 3,
)

INTEGRATORS = {method.name: method for method in (SDIRK2, BDF2)}
DEFAULT = SDIRK2  # docs/integrator.md says why
