"""What ln R may do over dose, form by form: a list of courses, each with two amplitudes that are not negative.

With x the dose over its range, 0 at the first check and 1 at the last, ln R(x) = start + first(x) a1 + second(x) a2,
where a1 and a2 are changes of ln R with half-normal priors. A form is a mixture of courses with the weights below:

- monotone: rises steadily (nine tenths of the weight; else falls): straight, curved, or both at once, where the curve
  is 1 - exp(-x / k) or a power of x.
- dip_then_rise: falls first, then rises: both straight or square, or resin that cures on, -(1 - exp(-x / k)), under a
  steady rise; or it rises to a level and stays there.
- changepoint: flat or of one slope up to a dose, of another slope from there on; never first down, then up.

A turn has two checks at least on either side of it.

The priors are those of a campaign up to the end of life, where conductivity is half. Of a specimen whose ln R went
further they are wider in proportion (`Courses.wider`): else two small amplitudes would be more probable than one large
one, and a straight line past its end of life a course that turns.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from analytics.insulation.arrays import HALVED, Floats, Ints

MONOTONE, DIP_THEN_RISE, CHANGEPOINT = "monotone", "dip_then_rise", "changepoint"
CHANGING = (MONOTONE, DIP_THEN_RISE, CHANGEPOINT)

RISE_SD = 0.3  # of ln R over a campaign, prior: conductivity at the end of life is half, ln R higher by 0.69
FALL_SD = 0.15  # of what post-cure brings
RELAXATIONS = (0.05, 0.1, 0.2, 0.4, 0.8)  # k of curves that level off
POWERS = (0.4, 0.5, 0.65, 0.8, 1.25, 1.5, 2.0, 2.5, 3.0, 4.0)  # of the others
LEVEL_EVERY, LEVELS_EVERY = 2, 5  # one place of turns in two has courses that become level, at a fifth as many places
CURE_SPAN = 0.4  # longest k of the cure


@dataclass(frozen=True)
class Courses:
    """A list of `a` courses at n doses. `columns` (a, n, 2): first(x) and second(x) of each; `sds` (a, 2) of the
    amplitudes' priors; `weight` (a,) within the form, summing to 1; `turn` (a,): x of its corner, and `level` (a,): x
    from which it stays level, NaN where there is none; `cell` (a,): the width in x that this corner stands for."""

    columns: Floats
    sds: Floats
    weight: Floats
    turn: Floats
    cell: Floats
    level: Floats

    def some(self, chosen: Ints) -> Courses:
        """The courses at the places `chosen` of the list."""
        return Courses(*(getattr(self, of.name)[chosen] for of in fields(self)))

    def wider(self, ln_resistance: Floats) -> Courses:
        """The courses with priors as wide as a series `ln_resistance` (n,) asks for that went past the end of life."""
        return replace(self, sds=self.sds * max(1.0, float(np.ptp(ln_resistance)) / HALVED))


def courses(form: str, x: Floats, at: Floats, turns: int) -> Courses | None:
    """The courses of `form` at the places `at` (n,), which turn where `turning_places` of the checks' places `x` says.
    None where the checks are too few for this form."""
    if form == MONOTONE:
        return _monotone(at)
    places = turning_places(x, turns)
    if places is None:
        return None
    return _changepoint(places, at) if form == CHANGEPOINT else _dip_then_rise(places, x, at)


def courses_of_all(x: Floats, at: Floats, turns: int) -> Courses:
    """The courses of every form for which the checks are enough, one form after the other; weights sum to the number
    of forms."""
    found = [given for form in CHANGING if (given := courses(form, x, at, turns)) is not None]
    return Courses(*(np.concatenate([getattr(given, of.name) for given in found]) for of in fields(Courses)))


def turning_places(x: Floats, turns: int) -> Floats | None:
    """Where courses may turn (turns,): middles of equal parts of the way from the second check to the last place that
    leaves two checks after it. `x`: places of the checks, ascending and distinct. None below four checks."""
    if len(x) < 4:
        return None
    low, high = x[1], (x[-3] + x[-2]) / 2
    return np.asarray(low + (high - low) * (np.arange(turns) + 0.5) / turns, np.float64)


def _monotone(at: Floats) -> Courses:
    curves = np.stack([np.expm1(-at / k) / np.expm1(-1.0 / k) for k in RELAXATIONS] + [at**p for p in POWERS])
    both = _pairs(np.tile(at, (len(curves), 1)), curves)
    straight, curved = _pairs(at[None], np.zeros((1, len(at)))), _pairs(curves, np.zeros_like(curves))
    parts = [
        (sign * part, share * weight, (sd, sd))
        for sign, share, sd in ((1, 0.9, RISE_SD), (-1, 0.1, FALL_SD))
        for part, weight in ((straight, 0.3), (curved, 0.4), (both, 0.3))
    ]
    nowhere = np.full(2 + 4 * len(curves), np.nan)
    return _joined(parts, turn=nowhere, cell=np.zeros(len(nowhere)))


def _changepoint(places: Floats, at: Floats) -> Courses:
    c = places[:, None]
    before, after = np.minimum(at, c) / c, np.maximum(at - c, 0.0) / (1.0 - c)
    flat = np.zeros_like(before)
    return _joined(
        [
            (_pairs(after, flat), 0.55, (RISE_SD, RISE_SD)),
            (_pairs(after, before), 0.30, (RISE_SD, RISE_SD)),
            (_pairs(-after, flat), 0.05, (FALL_SD, RISE_SD)),
            (_pairs(-after, before), 0.05, (FALL_SD, RISE_SD)),
            (_pairs(-after, -before), 0.05, (FALL_SD, FALL_SD)),
        ],
        turn=np.tile(places, 5),
        cell=np.full(5 * len(places), (places[-1] - places[0]) / (len(places) - 1)),
    )


def _dip_then_rise(places: Floats, x: Floats, at: Floats) -> Courses:
    c = places[:, None]
    before, after = np.maximum(1.0 - at / c, 0.0), np.maximum(at - c, 0.0) / (1.0 - c)
    sds = (RISE_SD, FALL_SD)
    turned = [(_pairs(after**p, before**q), 0.45 / 4, sds) for p in (1, 2) for q in (1, 2)]
    k = np.geomspace(min(x[1] / 2, CURE_SPAN / 2), CURE_SPAN, len(places))[:, None]
    cure = -np.expm1(-at / k)
    # Its slope at the start is what the cure starts from: it falls there, whatever the amplitudes.
    under = at - k * cure
    cured = (_pairs(under / (1.0 + k * np.expm1(-1.0 / k)), -cure), 0.35, sds)
    early = places[LEVEL_EVERY // 2 :: LEVEL_EVERY]
    shares = 1.0 - np.arange(1 + len(places) // LEVELS_EVERY) / (1 + len(places) // LEVELS_EVERY)
    turn = np.repeat(early, len(shares))
    level = turn + np.tile(shares, len(early)) * ((x[-3] + x[-2]) / 2 - turn)
    rise = np.clip((at - turn[:, None]) / (level - turn)[:, None], 0.0, 1.0)
    before = np.maximum(1.0 - at / turn[:, None], 0.0)
    levelled = [(_pairs(rise, before**q), 0.10, sds) for q in (1, 2)]
    width = (places[-1] - places[0]) / (len(places) - 1)
    nowhere = np.full(len(places), np.nan)
    return _joined(
        [*turned, cured, *levelled],
        turn=np.concatenate([np.tile(places, 4), nowhere, np.tile(turn, 2)]),
        cell=np.concatenate(
            [np.full(4 * len(places), width), 0.0 * k[:, 0], np.full(2 * len(turn), LEVEL_EVERY * width)]
        ),
        level=np.concatenate([np.tile(nowhere, 5), np.tile(level, 2)]),
    )


def _pairs(first: Floats, second: Floats) -> Floats:
    return np.stack([first, second], axis=-1)


def _joined(
    parts: list[tuple[Floats, float, tuple[float, float]]], turn: Floats, cell: Floats, level: Floats | None = None
) -> Courses:
    """The courses of several parts, each given as columns, the weight of the whole part, and the standard deviations
    of its amplitudes."""
    columns = np.concatenate([part for part, _, _ in parts])
    weight = np.concatenate([np.full(len(part), w / len(part)) for part, w, _ in parts])
    sds = np.concatenate([np.tile(sd, (len(part), 1)) for part, _, sd in parts])
    return Courses(columns, sds, weight, turn, cell, np.full(len(turn), np.nan) if level is None else level)
