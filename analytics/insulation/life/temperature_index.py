"""Temperature index and halving interval: where half of the specimens live 20,000 h, and how the life halves with heat.

After IEC 60216-1 and -3 (materials) and IEEE Std 117 (motorettes, looked at between heat cycles): lives at three
temperatures at least, equal spread, a straight line, a lower confidence limit near the index, no long extrapolation.
The standards compute with groups of complete or evenly censored lives; here the same questions are asked of the
likelihood, which takes any censoring. So an index from here is by the practice of the standard, not a report under it:
the limits below are to be checked against the edition that a report is made under.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from analytics.insulation.dose.arrhenius import LIFE_H
from analytics.insulation.life.bounds import Bounds, HalvingInterval, TemperatureIndex, estimate, profile
from analytics.insulation.life.checks import LawCheck, common_spread, linearity
from analytics.insulation.life.life import LifeFit, NoFit

TEMPERATURES = 3
ONE_SIDED = 0.90  # two-sided confidence whose lower end is a 95 % lower limit
DISPERSION = 0.6  # of the halving interval, between the index and its lower limit
EXTRAPOLATION_K = 25.0
LONGEST_H = 5_000.0  # median life at the coolest temperature


@dataclass(frozen=True)
class Condition:
    """What the practice asks, whether it is met, and the numbers."""

    asks: str
    met: bool
    says: str


@dataclass(frozen=True)
class Endurance:
    """`index` [degC] and `halving` [K] for `criterion` and `life_h` [h], with two-sided 95 % bounds;
    `lower_limit_degC`: the one-sided 95 % limit of the index. `written` as IEC writes it, "TI (HIC): 165.3 (18.4)";
    `conditions` that are not met are not to be left out beside it."""

    index: Bounds
    halving: Bounds
    lower_limit_degC: float
    life_h: float
    criterion: str
    conditions: tuple[Condition, ...]

    @property
    def met(self) -> bool:
        """Whether all conditions are."""
        return all(condition.met for condition in self.conditions)

    @property
    def written(self) -> str:
        """As IEC writes it."""
        return f"TI (HIC): {self.index.value:.1f} ({self.halving.value:.1f})"


def endurance(law: LifeFit, life_h: float = LIFE_H, seed: int = 0) -> Endurance | NoFit:
    """Index and halving interval at `life_h` [h]; `NoFit` with the reason where lives ended at fewer than three
    temperatures, do not get shorter with heat, or not that short however hot. `seed`: of the simulated tests."""
    seen = law.temperatures_degC
    if len(seen) < TEMPERATURES:
        few = "one temperature" if len(seen) == 1 else "two temperatures"
        reason = f"lives ended at {few} only: a temperature index needs three, as IEC 60216-1 and IEEE 117 ask"
        return NoFit(reason, law.criterion)
    if law.eV <= 0.0:
        return NoFit("lives do not get shorter with heat: there is no temperature index", law.criterion)
    if not math.isfinite(estimate(law, HalvingInterval(life_h))):
        reason = f"by this law no temperature makes the median life as short as {life_h / 2:g} h: there is no index"
        return NoFit(reason, law.criterion)
    index, halving = profile(law, TemperatureIndex(life_h)), profile(law, HalvingInterval(life_h))
    lower = profile(law, TemperatureIndex(life_h), ONE_SIDED).lower
    outside_K = max(seen[0] - index.value, index.value - seen[-1], 0.0)
    conditions = (
        _as_condition(linearity(law, seed=seed)),
        _as_condition(common_spread(law, seed=seed)),
        Condition(
            f"lower 95 % limit within {DISPERSION:g} halving intervals of the index",
            index.value - lower <= DISPERSION * halving.value,
            f"{lower:.1f} degC, {(index.value - lower) / halving.value:.2f} halving intervals below",
        ),
        Condition(
            f"extrapolation of at most {EXTRAPOLATION_K:g} K",
            outside_K <= EXTRAPOLATION_K,
            f"{outside_K:.1f} K outside {seen[0]:g} to {seen[-1]:g} degC, where lives ended",
        ),
        Condition(
            f"median life of at least {LONGEST_H:g} h at the coolest temperature",
            law.quantile(0.5, seen[0]) >= LONGEST_H,
            f"{law.quantile(0.5, seen[0]):.0f} h at {seen[0]:g} degC",
        ),
    )
    return Endurance(index, halving, lower, life_h, law.criterion, conditions)


def _as_condition(check: LawCheck) -> Condition:
    tested = f"{check.says} (p {check.p_value:.2g})" if check.degrees else check.says
    left_out = ", ".join(f"{t:g}" for t in check.left_out_degC)
    return Condition(check.asks, check.passed, tested + (f"; {left_out} degC left out" if left_out else ""))
