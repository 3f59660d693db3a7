"""What a channel's residual is made of besides the model's errors, and its whitening.

The covariance of the block means of one channel in one session is

    R[i, j] = (noise^2 + resolution^2 / 12) / m_i [i = j]
              + ar_sd^2 exp(-|t_i - t_j| / ar_tau) + ou_sd^2 exp(-|t_i - t_j| / ou_tau),

m samples a block: white noise, an autoregression of about a minute, and a slow Ornstein-Uhlenbeck discrepancy. Sessions
and channels are independent. Its Kalman filter (white as measurement noise, the other two as states) turns a column
into innovations divided by their standard deviations, `W x` with `W' W = R^-1`; a gap is a longer step. It costs O(B) a
column. Rasmussen and Williams, Gaussian Processes for Machine Learning (2006), B.2; Harvey, Forecasting, Structural
Time Series Models and the Kalman Filter (1989), 3.4.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from twin.errors import EvidenceError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Series:
    """Block means of one channel in one session; blocks with under half of their samples are not there.

    `t_s` (B,) [s] the blocks' centres, rising; `y` (B,) [K or degC]; `samples` (B,) how many each block holds;
    `white_sd` and `resolution` [K] of one sample; whether it was `measured` or is supposed (`twin.fitting.supposed`).
    """

    session: int
    channel: str
    t_s: Array
    y: Array
    samples: Array
    white_sd: float
    resolution: float
    measured: bool = True

    @property
    def white_variance(self) -> Array:
        """(B,) [K^2]: white noise and rounding, averaged over the block's samples."""
        result: Array = (self.white_sd**2 + self.resolution**2 / 12) / np.asarray(self.samples, dtype=np.float64)
        return result


@dataclass(frozen=True)
class ChannelNoise:
    """Standard deviations [K] and times [s] of the autoregression and of the slow Ornstein-Uhlenbeck discrepancy."""

    ar_sd: float
    ar_tau_s: float
    ou_sd: float
    ou_tau_s: float


def whiten(series: Series, noise: ChannelNoise, columns: Array) -> Array:
    """`W X` (B, k) of columns X (B, k), linear in X, `(W X)' (W X) = X' R^-1 X`.

    Raises `EvidenceError` where the columns are not as long as the series, times do not rise, or R is singular.
    """
    if columns.ndim != 2 or len(columns) != len(series.t_s):
        raise EvidenceError(
            f"{_called(series)}: columns of shape {columns.shape} for {len(series.t_s)} blocks: give one row a block"
        )
    return Whitening(series, noise, columns.shape[1])(columns)


class Whitening:
    """`W X` of columns X (B, k) of a series, whose rows are given in turn, as many at a time as there are.
    Raises `EvidenceError` as `whiten`."""

    def __init__(self, series: Series, noise: ChannelNoise, columns: int) -> None:
        self._gains = _checked_gains(series, noise)
        self._states = np.zeros((2, columns))
        self._done = 0

    def __call__(self, rows: Array) -> Array:
        """The next rows (b, k)."""
        out = np.array(rows, dtype=np.float64, order="C")
        _whiten(self._gains[self._done : self._done + len(out)], self._states, out)
        self._done += len(out)
        return out


def log_det(series: Series, noise: ChannelNoise) -> float:
    """`ln|R|` of one series [ln K^2]; the innovations' variances multiply to |R|. Raises as `whiten`."""
    return float(np.log(_checked_gains(series, noise)[:, 4]).sum())


def floor_variance(series: Series, noise: ChannelNoise) -> float:
    """Mean square [K^2] that no model of the motor can go below: white and autoregressive noise of a block."""
    return float(series.white_variance.mean()) + noise.ar_sd**2


def _called(series: Series) -> str:
    return f'channel "{series.channel}" of session {series.session}'


def _checked_gains(series: Series, noise: ChannelNoise) -> Array:
    if not (np.diff(series.t_s) > 0).all():
        raise EvidenceError(f"{_called(series)}: block times do not rise: sort the blocks and keep each once")
    gains: Array = filter_gains(series.t_s, series.white_variance, *_variances(noise))
    if not (gains[:, 4] > 0).all():
        raise EvidenceError(f"{_called(series)}: its noise has no variance: give it a white noise or a resolution")
    return gains


def _variances(noise: ChannelNoise) -> tuple[float, float, float, float]:
    return noise.ar_sd**2, noise.ar_tau_s, noise.ou_sd**2, noise.ou_tau_s


@numba.njit(error_model="numpy", nogil=True, cache=True)
def filter_gains(t: Array, white: Array, v_a: float, tau_a: float, v_o: float, tau_o: float) -> Array:
    """(B, 5): decay of both states over the step before, their gains, and the variance of the innovation."""
    out = np.empty((len(t), 5))
    p_aa, p_ao, p_oo = v_a, 0.0, v_o
    for i in range(len(t)):
        f_a = np.exp(-(t[i] - t[i - 1]) / tau_a) if i else 0.0
        f_o = np.exp(-(t[i] - t[i - 1]) / tau_o) if i else 0.0
        if i:
            p_aa = v_a + f_a * f_a * (p_aa - v_a)
            p_oo = v_o + f_o * f_o * (p_oo - v_o)
            p_ao *= f_a * f_o
        c_a, c_o = p_aa + p_ao, p_ao + p_oo
        s = c_a + c_o + white[i]
        k_a, k_o = (c_a / s, c_o / s) if s > 0 else (0.0, 0.0)
        p_aa -= k_a * c_a
        p_ao -= k_a * c_o
        p_oo -= k_o * c_o
        out[i, 0], out[i, 1], out[i, 2], out[i, 3], out[i, 4] = f_a, f_o, k_a, k_o, s
    return out


@numba.njit(error_model="numpy", nogil=True, cache=True)
def _whiten(gains: Array, states: Array, x: Array) -> None:
    """Rows of x (b, k) in place, from the `states` (2, k) of the rows before on."""
    a, o = states[0], states[1]
    for i in range(len(x)):
        f_a, f_o, k_a, k_o = gains[i, 0], gains[i, 1], gains[i, 2], gains[i, 3]
        scale = 1 / np.sqrt(gains[i, 4])
        for j in range(x.shape[1]):
            ahead_a, ahead_o = f_a * a[j], f_o * o[j]
            innovation = x[i, j] - ahead_a - ahead_o
            a[j] = ahead_a + k_a * innovation
            o[j] = ahead_o + k_o * innovation
            x[i, j] = innovation * scale


@numba.njit(error_model="numpy", nogil=True, cache=True)
def deviance(t: Array, white: Array, x: Array, v_a: float, tau_a: float, v_o: float, tau_o: float) -> float:
    """`ln|R| + sum of (W X)^2`: minus twice the log likelihood of columns x (B, k) that share one R,
    up to a constant."""
    gains = filter_gains(t, white, v_a, tau_a, v_o, tau_o)
    whitened = x.copy()
    _whiten(gains, np.zeros((2, x.shape[1])), whitened)
    total = 0.0
    for i in range(len(t)):
        total += np.log(gains[i, 4])
        for j in range(x.shape[1]):
            total += whitened[i, j] * whitened[i, j]
    return total
