"""The readings of a step, all at once: what they say of the state, and the state given them.

A reading y is linear in the state before the step and after it, as its samples have their mean time somewhere within
it. Its row holds cov(y, x after) for every number of the state, the prediction less the value read, and cov(y, y')
with all readings, noise included. Elimination of the readings' covariance S, on these rows, leaves independent
readings, and from them the gain K; the state takes the readings in Joseph's form, which holds for any gain, so that
what K is rounded by enters P squared (R. S. Bucy, P. D. Joseph, Filtering for Stochastic Processes, 1968). With G =
cov(x, y), of readings before and after the step alike, its products are

    (I - K H) P (I - K H)' + K R K' = P - K G' - (G - K S) K'.

As x stands beside P, what the covariance loses is what the state moves by. P is touched once a step, above its
diagonal.
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numba
import numpy as np
from numpy.typing import NDArray

from twin.arithmetic.lane_code import pointer
from twin.arithmetic.lanes import (
    NOWHERE,
    LaneStore,
    Sweep,
    less,
    mirrored,
    paired,
    row_less,
    scaled,
    sweep,
    width,
    within,
)
from twin.filters.inputs import Given
from twin.filters.matrix import amounts_at, counted, laws_at, surround, term_at
from twin.filters.plan import Plan, StateRows, psi_of, term_of, x_at

Floats = NDArray[np.float64]
Index = NDArray[np.int64]

LOG_2_PI = float(np.log(2 * np.pi))
u = np.uint64  # numba then asks of no index whether it counts from the end


class Entries(NamedTuple):
    """A list of which numbers of the state each reading takes, and which share of each. Behind each reading's entries
    there is one that ends them."""

    share: int  # numbers: of each entry, sign changed as `sweep` subtracts
    number: int  # indices: number of the state of each entry
    row: int  # for `sweep`: pairs of where that number's row begins and the entry; -1 ends a reading
    start: int  # (r + 1,) where a reading's entries begin


class ReadingsPlan(NamedTuple):
    """Where the readings of a step are, r of them at most: a row of `stride` numbers for each, and lists of what each
    takes of the state. Of the example of `twin.filters.plan`, of which W is read at the end of the step, 4.67 K above
    what was predicted, the second thermometer at a quarter of it, and a meter of all losses, the row of W at
    `crossed` is

        cov(y, x) of 7 numbers | -4.67 | up to number 16 what nobody reads | cov(y, y') with the three readings

    The entries of `later` are of the state after the step, those of `earlier` of the state before it, a share and a
    number each. W takes (-1, 0) and (-1, 5) later, the winding and its own error; the second takes (-0.25, 6) later and
    (-0.75, 6) earlier. The lists hold until other channels are read, or at other places in the step; those of meters
    for one step.
    """

    stride: int  # numbers of a row
    # Numbers, by where they begin.
    crossed: int  # a row for each reading
    gain: int  # a row for each, behind `crossed`; after `correct`: K', then what makes readings independent
    missed: int  # a row for each, behind `gain`: independent readings; after `correct`, (G - K S)'
    metered: int  # (r,) what a meter would read as predicted [W]
    place: int  # (m + q,) of each channel when the lists were made, below 0 where it was not read
    # Indices, by where they begin.
    number: int  # how many readings the lists are of
    channel: int  # (r,) of a reading
    rows: int  # for `sweep`: (r,) pairs of where a reading's row begins and 0, then -1
    each: int  # (r,) where a reading's row begins
    taken: int  # (r,) for `less`: pairs of that place with itself
    numbered: int  # (r,) pairs of that place and the reading
    before: int  # (r,) pairs of that place and where its covariance with the readings begins
    lost: int  # (2 r,) pairs for P - K G' - (G - K S) K': of `crossed` with `gain`, of `gain` with `missed`
    later: Entries
    earlier: Entries
    by_later: Sweep
    by_earlier: Sweep


class RowLayout(StateRows, Protocol):
    """What a `Plan`, and what the paper's form has instead, say of their rows to `readings_of` and `correct`."""

    @property
    def channels(self) -> int: ...
    @property
    def meters(self) -> int: ...
    @property
    def unit(self) -> int: ...
    @property
    def state(self) -> int: ...
    @property
    def ahead(self) -> int: ...
    @property
    def row(self) -> int: ...


def readings_of(plan: RowLayout, store: LaneStore) -> ReadingsPlan:
    """Where the readings of a step will be, for rows as `plan` says; `store` is given room for them."""
    most = plan.channels + plan.meters
    stride = plan.length + width(most)
    most_entries = most * (plan.size + 2) + 1
    begins = [q * stride for q in range(most)]
    rows = store.pairs([*((begin, 0) for begin in begins), (-1, 0)])
    crossed, beyond = store.rows(3 * most, stride), most * stride
    later, earlier = (_entries(most_entries, most, store) for _ in range(2))
    return ReadingsPlan(
        stride=stride,
        crossed=crossed,
        gain=crossed + most * stride,
        missed=crossed + 2 * most * stride,
        metered=store.rows(1, most),
        place=store.put(np.full(most, -2.0)),
        number=store.index([0]),
        channel=store.index([0] * most),
        rows=rows,
        each=store.index(begins),
        taken=store.pairs([(begin, begin) for begin in begins]),
        numbered=store.pairs([(begin, q) for q, begin in enumerate(begins)]),
        before=store.pairs([(begin, begin + plan.length) for begin in begins]),
        lost=store.pairs([pair for b in begins for pair in ((b, beyond + b), (beyond + b, 2 * beyond + b))]),
        later=later,
        earlier=earlier,
        by_later=Sweep(rows, later.row),
        by_earlier=Sweep(rows, earlier.row),
    )


def _entries(most: int, readings: int, store: LaneStore) -> Entries:
    """Room for a list of so many entries at most, of so many readings."""
    none = [0] * most
    share = store.put(np.zeros(most))
    return Entries(share, store.index(none), store.index(none), store.index([0] * (readings + 1)))


@within
def entries_of(taken: Entries, at: Index, q: int) -> tuple[int, int]:
    """The first entry of reading q, and the end of its entries."""
    return at[u(taken.start + q)], at[u(taken.start + q + 1)] - 1


@within
def entry_of(taken: Entries, m: Floats, at: Index, e: int) -> tuple[float, int]:
    """The share of an entry, sign changed, and the number of the state that it is of."""
    return m[u(taken.share + e)], at[u(taken.number + e)]


@within
def _add_entry(plan: Plan, taken: Entries, m: Floats, at: Index, q: int, i: int, share: float) -> None:
    """Add an entry of reading q, whose entries are the last of the list so far."""
    e = at[u(taken.start + q + 1)]
    m[u(taken.share + e)], at[u(taken.number + e)] = share, i
    at[u(taken.row + e)], at[u(taken.start + q + 1)] = paired(i * plan.length, e), e + 1


@within
def _enter(plan: Plan, r: ReadingsPlan, m: Floats, at: Index, q: int, i: int, share: float, place: float) -> None:
    """Enter that reading q takes `share` of number i of the state: `place` of it after the step, the rest before it."""
    if place != 0.0:
        _add_entry(plan, r.later, m, at, q, i, share * place)
    if place != 1.0:
        _add_entry(plan, r.earlier, m, at, q, i, share * (1 - place))


@within
def _end_entries(r: ReadingsPlan, at: Index, q: int) -> None:
    """End the entries of reading q in both lists."""
    for row, start in ((r.later.row, r.later.start), (r.earlier.row, r.earlier.start)):
        end = at[u(start + q + 1)]
        at[u(row + end)], at[u(start + q + 1)] = -1, end + 1


@within
def _enter_sensor(plan: Plan, r: ReadingsPlan, m: Floats, at: Index, j: int, place: float, q: int) -> None:
    """Enter what reading q of channel j takes, at `place` within the step: shares of nodes or of a lagging reading,
    and an error of its own."""
    if at[u(plan.channel_state + j)] >= 0:
        _enter(plan, r, m, at, q, at[u(plan.channel_state + j)], -1.0, place)
    else:
        for e in range(at[u(plan.node_start + j)], at[u(plan.node_start + j + 1)]):
            _enter(plan, r, m, at, q, at[u(plan.node + e)], m[u(plan.node_share + e)], place)
    if at[u(plan.channel_bias + j)] >= 0:
        _enter(plan, r, m, at, q, at[u(plan.channel_bias + j)], -1.0, 1.0)


@numba.njit(error_model="numpy", nogil=True, cache=True)
def meter(plan: Plan, r: ReadingsPlan, m: Floats, at: Index, j: int, outside: Floats, state: int, q: int) -> float:
    """What meter j of heat reads [W] in the state [P | x] at `state`, with the monomials of the step and boundaries
    `outside` [degC]; its slopes there become the entries of reading q."""
    n, size, first = plan.n, plan.size, plan.n + plan.heats
    begun = at[u(r.later.start + q)]
    slope = r.later.share + begun
    for i in range(size):
        _enter(plan, r, m, at, q, i, 0.0, 1.0)
    surround(plan, m, state, outside)
    amounts_at(plan, m, at, state)
    laws_at(plan.laws, m, at, plan.laws.each, plan.laws.total)
    signs = plan.signs + j * plan.laws.total
    for t in range(plan.terms):
        g, p, _ = term_of(plan, at, t)
        heat = psi_of(plan.laws, m, g)[0]
        m[u(slope + first + p)] -= m[u(signs + g)] * term_at(plan, m, at, t) * heat
    total: float = counted(plan.laws, m, at, n, plan.amounts, signs, slope)
    for i in range(n, first):
        m[u(slope + i)] = -m[u(plan.of_losses + j)]
        total += m[u(plan.of_losses + j)] * m[x_at(plan, state, i)]
    bias = at[u(plan.channel_bias + plan.channels + j)]
    if bias >= 0:
        m[u(slope + bias)] = -1.0
        total += m[x_at(plan, state, bias)]
    return total


@within
def _still_hold(plan: Plan, r: ReadingsPlan, m: Floats, values: Floats, places: Floats) -> bool:
    """Whether the lists are of the channels that are read now, at their places; `place` is set to these. A meter's
    slopes are those of one step."""
    hold = True
    for j in range(plan.channels + plan.meters):
        place = -1.0 if np.isnan(values[j]) else places[j]
        hold &= m[u(r.place + j)] == place and (j < plan.channels or place < 0.0)
        m[u(r.place + j)] = place
    return hold


@within
def _make_lists(
    plan: Plan, r: ReadingsPlan, m: Floats, at: Index, outside: Floats, values: Floats, places: Floats
) -> None:
    """Make the lists of the channels that are read, and fill `metered`."""
    q = at[u(NOWHERE)]  # 0, but no literal: for one, numba would compile all that takes it a second time
    for j in range(plan.channels + plan.meters):
        if np.isnan(values[j]):
            continue
        at[u(r.later.start + q + 1)] = at[u(r.later.start + q)]
        at[u(r.earlier.start + q + 1)] = at[u(r.earlier.start + q)]
        if j < plan.channels:
            _enter_sensor(plan, r, m, at, j, places[j], q)
        else:
            m[u(r.metered + q)] = meter(plan, r, m, at, j - plan.channels, outside, plan.ahead, q)
        _end_entries(r, at, q)
        at[u(r.rows + q)], at[u(r.channel + q)] = paired(q * r.stride, 0), j
        q += 1
    at[u(r.number)] = q
    at[u(r.rows + q)] = -1


@within
def at_step(given: Given, step: int) -> tuple[Floats, Floats, Floats, Floats, Floats]:
    """What one step is given: monomials (F,), boundaries (b,) [degC], and what is read (m + q,) [degC, W] with its
    places in the step and the variances of its noise."""
    f, b, channels = given.features.shape[1], given.boundaries.shape[1], given.values.shape[1]
    return (
        pointer(given.features, step * f),
        pointer(given.boundaries, step * b),
        pointer(given.values, step * channels),
        pointer(given.places, row_of(given.places, step) * channels),
        pointer(given.variances, row_of(given.variances, step) * channels),
    )


@within
def row_of(rows: Floats, step: int) -> int:
    """Which row of places or variances (N, channels) is step `step`'s; one row (1, channels) is every step's."""
    return step if len(rows) > 1 else 0


@numba.njit(error_model="numpy", nogil=True, cache=True)
def observe(
    plan: Plan,
    r: ReadingsPlan,
    m: Floats,
    at: Index,
    outside: Floats,
    values: Floats,
    places: Floats,
    variances: Floats,
) -> int:
    """Fill the rows of the readings of the step that `carry` just made, and return how many there are. `values` (m +
    q,) [degC, W], NaN where there is none, `places` in [0, 1] within the step, `variances` [K^2, W^2] of the noise.
    Meters are linear about the state as predicted."""
    length, size, stride, unit = plan.length, plan.size, r.stride, plan.unit
    if not _still_hold(plan, r, m, values, places):
        _make_lists(plan, r, m, at, outside, values, places)
    count: int = at[u(r.number)]
    sweep(m, at, r.by_later, r.crossed, plan.ahead, plan.ahead, unit, r.later.share, length)
    if at[u(r.earlier.start + count)] > count:
        sweep(m, at, r.by_earlier, r.crossed, r.crossed, plan.turned, unit + 1, r.earlier.share, length)
    for q in range(count):
        own, j = r.crossed + q * stride, at[u(r.channel + q)]
        if j >= plan.channels:
            m[u(own + size)] = m[u(r.metered + q)]
        m[u(own + size)] -= values[j]
        _covariances_of(plan, r, m, at, q, variances[j])
    return count


@within
def _covariances_of(plan: Plan, r: ReadingsPlan, m: Floats, at: Index, q: int, variance: float) -> None:
    """Fill cov(y_p, y_q) of every reading p up to q, behind both rows; `variance` of the noise of q."""
    stride, column, own = r.stride, plan.length + q, r.crossed + q * r.stride + plan.length
    for p in range(q):
        m[u(own + p)] = 0.0
    m[u(own + q)] = variance
    first, end = entries_of(r.later, at, q)
    for e in range(first, end):
        share, i = entry_of(r.later, m, at, e)
        for p in range(q + 1):
            m[u(own + p)] -= share * m[u(r.crossed + p * stride + i)]
    first, end = entries_of(r.earlier, at, q)
    for e in range(first, end):
        share, i = entry_of(r.earlier, m, at, e)
        for p in range(q + 1):
            m[u(own + p)] -= share * _covariance_before(plan, r, m, at, p, i)
    for p in range(q):
        m[u(r.crossed + p * stride + column)] = m[u(own + p)]


@within
def _covariance_before(plan: Plan, r: ReadingsPlan, m: Floats, at: Index, q: int, i: int) -> float:
    """cov(y_q, x_i), x_i before the step."""
    total, row = 0.0, i * plan.length
    first, end = entries_of(r.later, at, q)
    for e in range(first, end):
        share, c = entry_of(r.later, m, at, e)
        total -= share * m[u(plan.turned + row + c)]
    first, end = entries_of(r.earlier, at, q)
    for e in range(first, end):
        share, c = entry_of(r.earlier, m, at, e)
        total -= share * m[u(plan.state + row + c)]
    return total


@numba.njit(error_model="numpy", nogil=True, cache=True)
def correct(plan: RowLayout, r: ReadingsPlan, m: Floats, at: Index, count: int, innovations: Floats) -> float:
    """The state given the first `count` readings: [P | x] at `state` from that at `ahead`, symmetric to the last bit.
    Returns the log likelihood of the readings. Fills `innovations` (m + q, 2): each reading's difference from what
    those before it let expect [K, W], and its variance; NaN where there is no reading."""
    length, size, stride, unit, row = plan.length, plan.size, r.stride, plan.unit + 1, at[u(NOWHERE)]
    squares, product, logs = 0.0, 1.0, 0.0
    told = pointer(innovations, 0)
    for j in range(2 * (plan.channels + plan.meters)):
        told[u(j)] = np.nan
    for q in range(count):
        own = r.missed + row
        row_less(m, at, r.before, q, own, r.crossed + row, r.missed, unit, r.gain + q, stride)
        spread, innovation = m[u(own + length + q)], -m[u(own + size)]
        scale = 1.0 / spread
        scaled(m, r.gain + row, scale, own, stride)
        j = at[u(r.channel + q)]
        told[u(2 * j)], told[u(2 * j + 1)] = innovation, spread
        squares += innovation * innovation * scale
        product *= spread
        if not 1e-100 < product < 1e100:  # one logarithm for many readings, within the range of numbers
            logs, product = logs + np.log(product), 1.0
        row += stride
    for q in range(count - 2, -1, -1):
        own = r.gain + q * stride
        behind = own + length + q + 1
        row_less(m, at, r.numbered, count - 1 - q, own, own, own + stride, unit, behind, length)
    less(m, at, r.each, count, r.numbered, count, r.missed, r.crossed, r.gain, unit, r.crossed + length, stride, length)
    for i in range(0, size, 8):
        out, ahead, others = plan.state + i * length + i, plan.ahead + i * length + i, r.crossed + i
        rows = min(8, size - i)
        less(m, at, plan.row, rows, r.lost, 2 * count, out, ahead, others, unit, r.crossed + i, 1, length - i)
    mirrored(m, plan.state, size, length)
    likelihood: float = -0.5 * (squares + logs + np.log(product) + count * LOG_2_PI)
    return likelihood
