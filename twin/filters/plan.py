"""Where the numbers of a filter's step are: the state, the tables of indices that its loops go through, and their
names.

The state has S numbers: temperatures of n nodes, o unknown heats, u logarithms of unknown factors, errors of
channels, and what each channel reads now whose sensor lags. It stands beside its covariance as rows [P | x] of one
matrix (`twin.arithmetic.lanes`), so that what is done to P is done to x in the same breath: P_ij is number j of row
i, x_i is number S of row i, and a row is filled up with zeros to its `length`.

Every example below is of one motor: nodes 0 winding, 1 stator, 2 rotor, and the coolant as 3. Its groups are the
links 0 winding-stator, 1 stator-rotor and 2 stator-coolant, the losses 3 of the winding (copper) and 4 of the rotor.
Its unknowns are a heat at the rotor, a factor of link 0, and a constant error of the thermometer W at the winding. A
second thermometer, half stator and half rotor, lags. So S = 7, and x is

    winding [degC], stator [degC], rotor [degC], heat [W], ln factor, error of W [K], reading of the second [degC].
"""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from twin.arithmetic.lanes import Sweep, within
from twin.compiled.indexed import Program

Floats = NDArray[np.float64]
Index = NDArray[np.int64]

u = np.uint64  # numba then asks of no index whether it counts from the end


class Parts(NamedTuple):
    """A network, unknowns and readings as arrays, for all steps of a run: n nodes, K coefficients, G groups, o
    unknown heats, m thermometers, q meters of heat."""

    program: Program
    constant: Floats  # (n,) C / (gamma h) [W/K]
    copper: Floats  # (2,) alpha [1/K] and its reference [degC]
    nominal: Floats  # (K,) coefficients as the motor file has them
    factor_of: Index  # (K,) which unknown factor multiplies each coefficient, -1 for none
    heats: Index  # (o,) the node of each unknown heat
    places: Index  # (G, 7) and
    numbers: Floats  # (G, 2 + 2 knots), the groups' laws as `twin.compiled.laws.Table` has them
    unknown_factors: int
    sought: int  # temperatures and unknowns, which stand first in the state
    weights: Floats  # (m, n) of each node in what a thermometer measures
    bias: Index  # (m + q,) place in the state of each channel's constant error, -1 where none is sought
    state: Index  # (m,) place in the state of what a thermometer reads now, -1 where it does not lag
    lag: Floats  # (m, 3) of a lagging one: shares of its last reading, of the last temperature, of the temperature now
    signs: Floats  # (q, G) by which a meter adds up the heat of each group
    of_losses: Floats  # (q,) 1 where a meter reads the unknown heats too, else 0
    process: Floats  # (S,) variance that each step adds to each number of the state


class LawTable(NamedTuple):
    """Where the laws of G groups stand, and what they are at the temperatures of a step."""

    total: int  # groups, G
    knots: int  # most of a fluid's table
    # Numbers, by where they begin.
    copper: int  # alpha [1/K], reference [degC]
    numbers: int  # (G, 2 + 2 knots) as `twin.compiled.laws.Table`
    psi: int  # (G, 4) what an amount is multiplied by to be a heat, and its slopes with T_a, T_b and T_m
    temperatures: int  # (n + boundaries,) [degC] at which psi is wanted: of a `Plan`, those at the start of the step
    # Indices, by where they begin.
    places: int  # (G, 6) as `twin.compiled.laws.Table`. Of the copper loss: 0, -1, its number, -1, 0, 0
    each: int  # 0, 1, 2 ...: all groups


class Plan(NamedTuple):
    """How many there are of what a step works on, and where it begins in the run's array of numbers or of indices.

    A table has one row behind the other; its comment shows the row of the module's example. Read them by the
    functions below.
    """

    laws: LawTable
    n: int  # nodes
    heats: int  # o
    factors: int  # u
    size: int  # S
    length: int  # of a row of numbers: S + 1 + u, filled up
    monomials: int  # F, products of features
    groups: int  # numbers of a row of amounts: G, filled up
    terms: int  # of groups, those that an unknown factor multiplies
    varied: int  # rows of `vary`
    plains: int  # rows of `plain`
    rims: int  # rows of `rim`
    constants: int  # rows of `constant_heat`
    others: int  # rows of `other`
    bents: int  # entries of `bent`
    edges: int  # E, entries above the diagonal of the eliminated step matrix
    filled: int  # numbers of `fixed`
    drives: int  # different pairs of a node and an unknown factor that drives it
    channels: int  # m thermometers
    meters: int  # q
    lagging: int  # thermometers that lag
    around: int  # boundaries
    # Numbers, by where they begin.
    unit: int  # 0, 1
    own: int  # (n,) C / (gamma h) [W/K]
    fixed: int  # `values` before any step adds to them
    inverse: int  # (n,) 1 / own
    process: int  # (S,) variances that each step adds
    # The second stage begins at s times the temperatures of the first, less s - 1 times those at the start.
    own_begun: int  # (n,) own times s
    own_less: int  # (n,) own times s - 1
    more: int  # 1 / (s - 1)
    constant: int  # (G,) what no feature changes of each group's amount
    by_monomial: int  # (varied,) what a monomial of 1 adds to a group's amount, for each row of `vary`
    nominal: int  # (terms,) coefficients that an unknown factor multiplies
    node_share: int  # weights of the nodes of all thermometers, sign changed: -1, -0.5, -0.5
    before: int  # the same times what a lagging reading takes of the temperatures before the step
    now: int  # and of those after it
    kept: int  # 1, then (m,) what a lagging reading takes of itself
    signs: int  # (q, G) as in `Parts`
    of_losses: int  # (q,) as in `Parts`
    features: int  # (F,) monomials of the step
    amounts: int  # (G,) W/K of links, W of losses
    scale: int  # (factors,) exp of their logarithms in x
    # Step matrix: n diagonals, E entries above them, E below; then -1, right-hand side (n,), drives (2, drives).
    values: int
    beyond: int  # (2, n) temperatures of each stage less those at the start
    stage: int  # n + o + u rows
    state: int  # [P | x]
    moved: int  # F P, but for the columns of F that are the factors'
    turned: int  # its transpose; in the column of x, x before the step
    driven_rows: int  # whole blocks of columns of F, the factors' among them, as rows
    ahead: int  # [P | x] as predicted, in place of `moved`
    # Indices, by where they begin.
    row: int  # 0, 16, 32 ...: where each row of the state begins
    term: int  # (terms, 3) group, factor, monomial or -1: 0, 0, 0
    vary: int  # (varied,) pairs of a group and a monomial that adds to its amount: (2, 1) (3, 2) (4, 3)
    plain: int  # (plains, 5) links that change: group, places of aa, bb, ab, ba in `values`: 0, 0, 1, 3, 5
    rim: int  # (rims, 4) the same to a boundary: group, aa, right-hand side of a, which temperature: 2, 1, 9, 3
    constant_heat: int  # (constants, 2) losses that no temperature changes: group, right-hand side of a: 4, 10
    other: int  # (others, 8) group, aa, ab, am, ba, bb, bm, right-hand side of b: 3, 0, -1, -1, -1, -1, -1, -1
    bent: int  # groups whose psi and slopes a step needs: 0, 3
    order: int  # (n,) the pivots
    edge_start: int  # (n + 1,) where each pivot's entries begin among the E
    update: int  # places in `values` that elimination takes its products from, in the order of the loops
    driven: int  # (terms, 4) term, group, which drive goes into a and which comes out of b, or -1: 0, 0, 0, 1
    by_factor: int  # (factors,) pairs: where the factor's row begins in `driven_rows`, and the factor
    node_start: int  # (m + 1,) where each thermometer's nodes begin in `node`: 0, 1, 3
    node: int  # nodes of all thermometers: 0, 1, 2
    channel_state: int  # (m,) place in x of what a lagging thermometer reads, -1 where it does not lag: -1, 6
    channel_bias: int  # (m + q,) place in x of a channel's constant error, or -1: 5, -1, -1
    forward: Sweep  # elimination, forward, of a stage's rows: nodes and unknown heats
    driven_first: Sweep  # the same with the factors' rows, in the first stage
    driven_second: Sweep  # and in the second
    backward: Sweep  # elimination, backward
    unmoved: Sweep  # what becomes of rows that are no temperature: they stay, and lagging readings fade
    follow: Sweep  # what lagging readings take of the temperatures after the step


class StateRows(Protocol):
    """Rows of [P | x], of `length` numbers each: a `Plan` has them, and what the paper's form has instead."""

    @property
    def size(self) -> int: ...
    @property
    def length(self) -> int: ...


@within
def x_at(plan: StateRows, rows: int, i: int) -> np.uint64:
    """The place of x_i in the matrix [P | x] that begins at `rows`."""
    return u(rows + i * plan.length + plan.size)


@within
def entry_at(plan: StateRows, rows: int, i: int, j: int) -> np.uint64:
    """The place of P_ij in the matrix [P | x] that begins at `rows`."""
    return u(rows + i * plan.length + j)


@within
def right_hand_side(plan: Plan) -> int:
    """Where the step matrix' right-hand side (n,) begins."""
    return plan.values + plan.n + 2 * plan.edges + 1


@within
def drives_at(plan: Plan) -> int:
    """Where the heats begin that unknown factors multiply, of both stages (2, drives), sign changed [W]."""
    return plan.values + 2 * plan.n + 2 * plan.edges + 1


@within
def term_of(plan: Plan, at: Index, t: int) -> tuple[int, int, int]:
    """Of a term that an unknown factor multiplies: its group, the factor, and its product of features, -1 for none."""
    row = plan.term + 3 * t
    return at[u(row)], at[u(row + 1)], at[u(row + 2)]


@within
def law_of(laws: LawTable, at: Index, g: int) -> tuple[int, int]:
    """The number of group g's law, and how many knots its fluid's table has."""
    row = laws.places + 6 * g
    return at[u(row + 2)], at[u(row + 5)]


@within
def ends_of(laws: LawTable, at: Index, g: int) -> tuple[int, int, int]:
    """Whose temperatures are T_a, T_b and T_m in group g: a node, or n + boundary; below 0 where its law has none of
    them."""
    row = laws.places + 6 * g
    return at[u(row)], at[u(row + 1)], at[u(row + 3)]


@within
def psi_of(laws: LawTable, m: Floats, g: int) -> tuple[float, float, float, float]:
    """What group g's amount is multiplied by to be a heat, and its slopes with T_a, T_b and T_m."""
    row = laws.psi + 4 * g
    return m[u(row)], m[u(row + 1)], m[u(row + 2)], m[u(row + 3)]


@within
def driven_of(plan: Plan, at: Index, d: int) -> tuple[int, int, int, int]:
    """A heat that an unknown factor multiplies: its term and group, which of a stage's drives is the heat into a, and
    which the heat out of b, -1 where there is no such node."""
    row = plan.driven + 4 * d
    return at[u(row)], at[u(row + 1)], at[u(row + 2)], at[u(row + 3)]
