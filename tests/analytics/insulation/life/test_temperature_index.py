"""Temperature index and halving interval, and what stands beside them."""

from __future__ import annotations

import numpy as np
import pytest

from analytics.insulation.dose.arrhenius import BOLTZMANN_EV_PER_K, ZERO_DEGC_IN_K
from analytics.insulation.life.bounds import TemperatureIndex, profile
from analytics.insulation.life.life import LifeFit, NoFit, fit
from analytics.insulation.life.temperature_index import Endurance, endurance
from made.published_lives import class_b, class_h


def of(law: LifeFit | NoFit, life_h: float = 20_000.0) -> Endurance:
    assert isinstance(law, LifeFit)
    found = endurance(law, life_h)
    assert isinstance(found, Endurance), found
    return found


def why_not(law: LifeFit | NoFit) -> str:
    assert isinstance(law, LifeFit)
    found = endurance(law)
    assert isinstance(found, NoFit)
    assert found.criterion == "breakdown"
    return found.reason


def test_class_h_motorettes_have_an_index_by_hand() -> None:
    degC, life = class_h()
    found = of(fit(degC, life, life, "lognormal", criterion="breakdown"))
    slope, start = np.polyfit(1 / (degC + ZERO_DEGC_IN_K), np.log(life), 1)
    index, hotter = (slope / (np.log(h) - start) - ZERO_DEGC_IN_K for h in (20_000.0, 10_000.0))
    assert found.index.value == pytest.approx(index, abs=1e-7)
    assert found.halving.value == pytest.approx(hotter - index, abs=1e-7)
    assert found.written == "TI (HIC): 165.3 (18.4)"
    assert (found.criterion, found.life_h) == ("breakdown", 20_000.0)


def test_the_lower_limit_is_one_sided() -> None:
    law = fit(*class_b(), "lognormal", criterion="breakdown")
    found = of(law)
    assert isinstance(law, LifeFit)
    assert found.index.lower < found.lower_limit_degC < found.index.value
    assert found.lower_limit_degC == profile(law, TemperatureIndex(), 0.90).lower


def test_what_the_practice_asks_and_class_b_does_not_meet_is_said() -> None:
    found = of(fit(*class_b(), "lognormal", criterion="breakdown"))
    assert not found.met
    missed = [condition.asks for condition in found.conditions if not condition.met]
    assert missed == [
        "one spread at all temperatures",
        "lower 95 % limit within 0.6 halving intervals of the index",
        "extrapolation of at most 25 K",
    ]
    assert any("150 degC left out" in condition.says for condition in found.conditions)


def test_lives_as_the_practice_wants_them_meet_everything() -> None:
    random = np.random.default_rng(5)
    degC = np.repeat([200.0, 220.0, 240.0], 20)
    inverse = 1 / BOLTZMANN_EV_PER_K * (1 / (degC + ZERO_DEGC_IN_K) - 1 / (180.0 + ZERO_DEGC_IN_K))
    life = 20_000.0 * np.exp(1.1 * inverse + 0.1 * random.standard_normal(60))
    found = of(fit(degC, life, life, "lognormal", criterion="breakdown"))
    assert found.met
    assert found.index.lower < 180.0 < found.index.upper
    assert found.index.upper - found.index.lower < 5.0


def test_fewer_than_three_temperatures_are_refused_and_still_fitted() -> None:
    degC, life = class_h()
    two = degC > 230.0
    law = fit(degC[two], life[two], life[two], "lognormal", criterion="breakdown")
    assert "needs three" in why_not(law)
    assert isinstance(law, LifeFit)
    assert law.quantile(0.5, 180.0) > law.quantile(0.5, 220.0)


def test_a_temperature_where_nothing_ended_does_not_count() -> None:
    degC, lower, upper = class_b()
    kept = degC != 190.0
    assert "two temperatures" in why_not(fit(degC[kept], lower[kept], upper[kept], "weibull", criterion="breakdown"))


def test_an_index_above_the_tested_temperatures_is_an_extrapolation_too() -> None:
    degC, life = class_h()
    found = of(fit(degC, life, life, "lognormal", criterion="breakdown"), life_h=100.0)
    asked = {condition.asks: condition for condition in found.conditions}["extrapolation of at most 25 K"]
    assert found.index.value > 285.0
    assert not asked.met
    assert f"{found.index.value - 260.0:.1f} K outside 190 to 260 degC" in asked.says


def test_lives_that_stay_long_however_hot_have_no_index() -> None:
    degC = np.repeat([200.0, 220.0, 240.0], 4)
    inverse = 1 / (BOLTZMANN_EV_PER_K * (degC + ZERO_DEGC_IN_K))
    spread = np.tile([0.9, 1.1, 1.05, 0.95], 3)
    life = 90_000.0 * np.exp(0.05 * (inverse - inverse[0])) * spread
    assert "no temperature makes the median life as short as 10000 h" in why_not(
        fit(degC, life, life, "lognormal", criterion="breakdown")
    )


def test_lives_that_grow_with_heat_have_no_index() -> None:
    degC = np.repeat([200.0, 220.0, 240.0], 2)
    life = np.array([100.0, 120.0, 200.0, 220.0, 400.0, 410.0])
    assert "shorter with heat" in why_not(fit(degC, life, life, "lognormal", criterion="breakdown"))
