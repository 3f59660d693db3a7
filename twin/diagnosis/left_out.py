"""What a fit says of each session from the others alone, without fitting again.

The Hessian and the slope of a fit are sums over sessions. Without session s the mode is one Newton step away,

    theta_s = theta - (H - H_s)^-1 A_s' e_s,

with A_s (n, p) the session's whitened columns, e_s (n,) its whitened residual and H_s = A_s'A_s; one run of the session
there gives its error. Its log predictive density is that of a normal with the covariance I + A_s (H - H_s)^-1 A_s'.
What a session brings along (its start, what its sensors are off by that day) nothing says before it is run: there its
prior stands. Leave-one-out by case deletion: R. D. Cook, Technometrics 19 (1977) 15,
doi:10.1080/00401706.1977.10489493; log predictive densities to choose by: S. Geisser, W. F. Eddy, J. Am. Stat. Assoc.
74 (1979) 153, doi:10.1080/01621459.1979.10481632.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve, cholesky

from twin.errors import DivergedError
from twin.fitting.fit import Fit
from twin.fitting.model import Columns, Floats
from twin.fitting.noise import log_det


@dataclass(frozen=True)
class LeftOut:
    """How well every session is predicted from the others: `log_scores` (s,) ln predictive density, minus infinity
    where the model without it runs away; `errors_K`: channel -> (s,) mean size of its error, not a number where the
    session does not have the channel."""

    log_scores: Floats
    errors_K: Mapping[str, Floats]

    def by_channel_K(self) -> dict[str, float]:
        """Channel -> mean error over its sessions; none where the model runs away without any of them."""
        known = {channel: errors[np.isfinite(errors)] for channel, errors in self.errors_K.items()}
        return {channel: float(errors.mean()) for channel, errors in known.items() if errors.size}

    def by_session_K(self) -> Floats:
        """(s,) mean error over the channels of each session; not a number where the model runs away without it."""
        errors = np.ma.masked_invalid(np.array(list(self.errors_K.values())))
        return np.asarray(errors.mean(axis=0).filled(np.nan), np.float64)

    def mean_K(self) -> float:
        """Mean error over channels; infinite where there is none."""
        errors = list(self.by_channel_K().values())
        return float(np.mean(errors)) if errors else math.inf

    def is_as_near_as(self, other: LeftOut) -> bool:
        """Whether sessions are no farther off than with `other`, but for one standard error of that over them (L.
        Breiman, J. Friedman, R. Olshen, C. Stone, Classification and Regression Trees, 1984, 3.4.3)."""
        farther = self.by_session_K() - other.by_session_K()
        known = farther[np.isfinite(farther)]
        return known.size < 2 or float(known.mean()) <= float(known.std(ddof=1)) / math.sqrt(known.size)

    def gained(self, before: LeftOut) -> Floats:
        """(s,) ln density that each session gained over `before`; nothing where the model ran away before."""
        known = np.isfinite(before.log_scores)
        return np.where(known, self.log_scores - np.where(known, before.log_scores, 0.0), 0.0)


def left_out(found: Fit, reading: int | None = None) -> LeftOut:
    """Every session of a fit, predicted from the others. `reading`: the place in the vector of what a sensor is said to
    get wrong; errors are then of its readings as they were recorded, for a ruler that is moved proves nothing."""
    sessions = len(found.model.tests)
    parts = found.linearised()
    channels = dict.fromkeys(series.channel for series in found.series if series.measured)
    errors = {channel: np.full(sessions, np.nan) for channel in channels}
    scores = np.full(sessions, -np.inf)
    for session in range(sessions):
        own = [part for part in parts if part.series.session == session]
        try:
            scores[session], of_session = _predicted(found, session, own, reading)
        except (DivergedError, np.linalg.LinAlgError):
            continue
        for channel, error in of_session.items():
            errors[channel][session] = error
    return LeftOut(scores, errors)


def _predicted(found: Fit, session: int, own: Sequence[Columns], reading: int | None) -> tuple[float, dict[str, float]]:
    """The log score of one session and the mean size of its errors by channel."""
    model, at, free = found.model, own[0].at, found.free
    white = np.concatenate([model.whitened(p.series, np.column_stack([p.series.y, p.columns])) for p in own])
    residual, columns = white[:, 0], white[:, 1:]
    others = found.hessian.copy()
    others[np.ix_(at, at)] -= columns.T @ columns
    slope = np.zeros(found.beta.size)
    slope[at] = columns.T @ residual
    factor = cho_factor(others[np.ix_(free, free)], lower=True)
    without = found.beta.copy()
    without[free] -= cho_solve(factor, slope[free])
    without = np.clip(without, model.low, model.high)
    without[[p.test == session for p in model.parameters]] = 0.0
    ran = model.residuals_of(session, without)
    error = np.concatenate([model.whitened(s, s.y[:, None])[:, 0] for s in ran])
    covariance = np.zeros_like(others)
    covariance[np.ix_(free, free)] = cho_solve(factor, np.eye(int(free.sum())))
    inside = free[at]
    score = _log_density(error, columns[:, inside], covariance[np.ix_(at[inside], at[inside])])
    volume = sum(log_det(s, model.noise_of(s.channel)) for s in ran)
    if reading is not None:
        without[reading] = 0.0
        ran = model.residuals_of(session, without)
    return score - volume / 2, {s.channel: float(np.abs(s.y).mean()) for s in ran if s.measured}


def _log_density(error: Floats, columns: Floats, covariance: Floats) -> float:
    """ln density of a whitened error (n,) under I + A C A', without -n ln(2 pi) / 2."""
    spread = columns @ cholesky(covariance, lower=True)
    inner = np.eye(spread.shape[1]) + spread.T @ spread
    seen = spread.T @ error
    fitted = seen @ cho_solve(cho_factor(inner), seen)
    return -float(error @ error - fitted + np.linalg.slogdet(inner)[1]) / 2
