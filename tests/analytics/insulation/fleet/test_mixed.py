"""Mixed models: against published fits, and against the Gaussian density of all rows written out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from analytics.insulation.fleet import mixed

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

# Reaction time [ms] of 18 people after 0 to 9 days of little sleep: Belenky et al., J. Sleep Res. 12 (2003) 1,
# DOI 10.1046/j.1365-2869.2003.00337.x; the data set `sleepstudy` of lme4.
REACTION_ms = """
249.56 258.7047 250.8006 321.4398 356.8519 414.6901 382.2038 290.1486 430.5853 466.3535
222.7339 205.2658 202.9778 204.707 207.7161 215.9618 213.6303 217.7272 224.2957 237.3142
199.0539 194.3322 234.32 232.8416 229.3074 220.4579 235.4208 255.7511 261.0125 247.5153
321.5426 300.4002 283.8565 285.133 285.7973 297.5855 280.2396 318.2613 305.3495 354.0487
287.6079 285 301.8206 320.1153 316.2773 293.3187 290.075 334.8177 293.7469 371.5811
234.8606 242.8118 272.9613 309.7688 317.4629 309.9976 454.1619 346.8311 330.3003 253.8644
283.8424 289.555 276.7693 299.8097 297.171 338.1665 332.0265 348.8399 333.36 362.0428
265.4731 276.2012 243.3647 254.6723 279.0244 284.1912 305.5248 331.5229 335.7469 377.299
241.6083 273.9472 254.4907 270.8021 251.4519 254.6362 245.4523 235.311 235.7541 237.2466
312.3666 313.8058 291.6112 346.1222 365.7324 391.8385 404.2601 416.6923 455.8643 458.9167
236.1032 230.3167 238.9256 254.922 250.7103 269.7744 281.5648 308.102 336.2806 351.6451
256.2968 243.4543 256.2046 255.5271 268.9165 329.7247 379.4445 362.9184 394.4872 389.0527
250.5265 300.0576 269.8939 280.5891 271.8274 304.6336 287.7466 266.5955 321.5418 347.5655
221.6771 298.1939 326.8785 346.8555 348.7402 352.8287 354.4266 360.4326 375.6406 388.5417
271.9235 268.4369 257.2424 277.6566 314.8222 317.2135 298.1353 348.1229 340.28 366.5131
225.264 234.5235 238.9008 240.473 267.5373 344.1937 281.1481 347.5855 365.163 372.2288
269.8804 272.4428 277.8989 281.7895 279.1705 284.512 259.2658 304.6306 350.7807 369.4692
269.4117 273.474 297.5968 310.6316 287.1726 329.6076 334.4818 343.2199 369.1417 364.1236
"""


def test_a_published_fit_is_reproduced_to_the_digits_printed() -> None:
    """lmer(Reaction ~ Days + (Days | Subject), sleepstudy) of Bates et al., J. Stat. Softw. 67 (2015) 1, section
    1.2."""
    y = np.array(REACTION_ms.split(), np.float64)
    found = mixed.fit(np.repeat(np.arange(18), 10), np.tile(np.arange(10.0), 18), y, np.ones(180))
    assert found.deviance == pytest.approx(1743.6, abs=0.05)
    assert found.start_sd == pytest.approx(24.740, abs=0.002)
    assert found.slope_sd == pytest.approx(5.922, abs=0.001)
    assert found.correlation == pytest.approx(0.066, abs=0.0006)
    assert found.scale == pytest.approx(25.592, abs=0.001)
    assert found.fixed == pytest.approx([251.405, 10.467], abs=0.0006)
    assert np.sqrt(np.diag(found.fixed_covariance)) == pytest.approx([6.825, 1.546], abs=0.001)


@dataclass(frozen=True)
class Rows:
    who: Ints
    dose: Floats
    y: Floats
    sd: Floats
    batch: Ints


def _rows(seed: int, slope_sd: float = 2e-4) -> Rows:
    random = np.random.default_rng(seed)
    specimens, checks = 12, 7
    who = np.repeat(np.arange(specimens), checks)
    dose = random.uniform(0.0, 300.0, len(who))
    batch = np.repeat([0, 1, 2, -1], 3)
    sd = 0.03 * random.uniform(0.7, 1.5, len(who))
    of_batch = np.append(2e-4 * random.standard_normal(3), 0.0)[batch]
    slope = 3e-4 + slope_sd * random.standard_normal(specimens) + of_batch
    y = -3.8 + 0.06 * random.standard_normal(specimens)[who] + slope[who] * dose
    y += sd * random.standard_normal(len(who))
    return Rows(who, dose, y, sd, batch)


def _pair(fit: mixed.MixedFit) -> Floats:
    across = fit.correlation * fit.start_sd * fit.slope_sd
    return np.array([[fit.start_sd**2, across], [across, fit.slope_sd**2]])


def _covariance(rows: Rows, fit: mixed.MixedFit) -> Floats:
    """Of all rows."""
    z = np.column_stack([np.ones_like(rows.dose), rows.dose])
    same = rows.who[:, None] == rows.who
    total = same * (z @ _pair(fit) @ z.T) + np.diag((fit.scale * rows.sd) ** 2)
    of = rows.batch[rows.who]
    total += ((of[:, None] == of) & (of >= 0)) * fit.batch_slope_sd**2 * np.outer(rows.dose, rows.dose)
    return np.asarray(total, np.float64)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_deviance_and_fixed_effects_are_those_of_the_density_written_out(seed: int) -> None:
    rows = _rows(seed)
    fit = mixed.fit(rows.who, rows.dose, rows.y, rows.sd, batch=rows.batch)
    x = np.column_stack([np.ones_like(rows.dose), rows.dose])
    v = _covariance(rows, fit)
    information = x.T @ np.linalg.solve(v, x)
    beta = np.linalg.solve(information, x.T @ np.linalg.solve(v, rows.y))
    rest = rows.y - x @ beta
    deviance = np.linalg.slogdet(v)[1] + np.linalg.slogdet(information)[1] + rest @ np.linalg.solve(v, rest)
    deviance += (len(rest) - 2) * np.log(2.0 * np.pi)
    assert fit.deviance == pytest.approx(deviance, abs=1e-8)
    assert fit.fixed == pytest.approx(beta, rel=1e-8)
    assert fit.fixed_covariance == pytest.approx(np.linalg.inv(information), rel=1e-8)


@pytest.mark.parametrize("place", [0, 11])  # in a batch, and in none
def test_predictions_and_their_errors_are_those_of_the_joint_gaussian(place: int) -> None:
    rows = _rows(1)
    fit = mixed.fit(rows.who, rows.dose, rows.y, rows.sd, batch=rows.batch)
    x = np.column_stack([np.ones_like(rows.dose), rows.dose])
    inverse = np.linalg.inv(_covariance(rows, fit))
    beta_covariance = np.linalg.inv(x.T @ inverse @ x)
    own, pair = (rows.who == place).astype(float), _pair(fit)
    across = np.array([own * (pair[0, 0] + pair[0, 1] * rows.dose), own * (pair[0, 1] + pair[1, 1] * rows.dose)])
    if rows.batch[place] >= 0:
        across[1] += (rows.batch[rows.who] == rows.batch[place]) * fit.batch_slope_sd**2 * rows.dose
        pair[1, 1] += fit.batch_slope_sd**2
    projector = inverse - inverse @ x @ beta_covariance @ x.T @ inverse
    assert fit.effect[place] == pytest.approx(across @ inverse @ (rows.y - x @ fit.fixed), rel=1e-7)
    assert fit.joint[place][2:, 2:] == pytest.approx(pair - across @ projector @ across.T, rel=1e-7)
    assert fit.joint[place][:2, 2:] == pytest.approx(-beta_covariance @ x.T @ inverse @ across.T, rel=1e-7)


def test_no_other_variances_have_a_smaller_deviance() -> None:
    rows = _rows(2)
    least = mixed.fit(rows.who, rows.dose, rows.y, rows.sd, batch=rows.batch).deviance
    sums = mixed._Sums.of(rows.who, rows.dose, rows.y, rows.sd, mixed.STRAIGHT, rows.batch)
    random = np.random.default_rng(0)
    tried = [mixed._solve(sums, np.exp(random.uniform(-4.0, 1.5, 4))).deviance for _ in range(300)]
    assert min(tried) > least - 1e-6


def test_a_variance_of_zero_leaves_the_fixed_effects_right() -> None:
    """Equal slopes, made so that residuals are smaller than chance allows: the variance between slopes is estimated as
    0."""
    dose, who = np.tile(np.arange(6.0) * 10.0, 8), np.repeat(np.arange(8), 6)
    wobble = 0.01 * np.tile([1.0, -1.0, 1.0, -1.0, 1.0, -1.0], 8)
    start = np.repeat(np.linspace(-0.1, 0.1, 8), 6)
    fit = mixed.fit(who, dose, -3.0 + 0.002 * dose + start + wobble, np.full(48, 0.01))
    straight = np.polyfit(dose, -3.0 + 0.002 * dose + start + wobble, 1)
    assert fit.slope_sd == 0.0
    assert fit.correlation == 0.0
    assert fit.fixed == pytest.approx(straight[::-1], rel=1e-9)
    kept = mixed.fit(who, dose, -3.0 + 0.002 * dose + start + wobble, np.full(48, 0.01), nondegenerate=True)
    assert kept.slope_sd > 0.0
    assert kept.fixed == pytest.approx(straight[::-1], rel=1e-9)


def test_a_specimen_with_few_checks_borrows_from_the_rest() -> None:
    random = np.random.default_rng(4)
    counts = np.array([20] * 30 + [3])
    who = np.repeat(np.arange(31), counts)
    dose = np.concatenate([np.arange(n) * 12.0 for n in counts])
    slope = np.append(3e-4 + 1e-4 * random.standard_normal(30), 3e-4)
    y = slope[who] * dose + 0.03 * random.standard_normal(len(who))
    y[-3:] = [0.0, 0.05, 0.10]  # its own slope would be fourteen times the others'
    fit = mixed.fit(who, dose, y, np.full(len(who), 0.03))
    assert abs(fit.fixed[1] + fit.effect[-1, 1]) < 2.0 * fit.fixed[1]
    assert fit.joint[-1, 3, 3] > 2.0 * np.median(fit.joint[:-1, 3, 3])


@pytest.mark.parametrize("scatter_h", [0.0, 0.1])
@pytest.mark.parametrize("checks", [2, 3, 4, 5])
def test_courses_of_few_checks_at_the_same_doses_have_as_many_bends_as_these_tell(
    checks: int, scatter_h: float
) -> None:
    """The quartiles of four doses are three doses between them: a line with three bends goes through any four."""
    random = np.random.default_rng(6)
    who, dose = np.repeat(np.arange(60), checks), np.tile(np.arange(checks) * 24.0, 60)
    dose = np.abs(dose + scatter_h * random.standard_normal(len(who)))
    y = 3e-4 * dose + 5e-6 * dose**2 + 0.01 * random.standard_normal(len(who))
    fit, knots = mixed.fit_course(who, dose, y, 0.01)
    assert len(knots) <= checks - 2
    ends = mixed.bent_line([0.0, 24.0 * (checks - 1)], knots) @ fit.fixed
    last = 24.0 * (checks - 1)
    assert ends[1] - ends[0] == pytest.approx(3e-4 * last + 5e-6 * last**2, abs=0.006)


def test_bends_are_kept_only_where_the_courses_bend() -> None:
    random = np.random.default_rng(5)
    who, dose = np.repeat(np.arange(40), 12), np.tile(np.arange(12) * 12.0, 40)
    straight = 3e-4 * dose + 0.02 * random.standard_normal(len(who))
    assert len(mixed.fit_course(who, dose, straight, 0.02)[1]) == 0
    bent, knots = mixed.fit_course(who, dose, straight + 5e-6 * dose**2, 0.02)
    assert len(knots) == 3
    ends = mixed.bent_line([0.0, 132.0], knots) @ bent.fixed
    assert ends[1] - ends[0] == pytest.approx(3e-4 * 132.0 + 5e-6 * 132.0**2, rel=0.1)
