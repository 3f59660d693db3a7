"""What a run's summary says of heat, hot spots, limits and derating, in sentences."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from ingest.texts.times import clock
from ingest.texts.units import as_written
from replay.engine.results.summary import DeratingCourse, MeterErrors, ModelledSpot, SmoothedSpot, Summary
from replay.engine.specimen.aged import LAW
from replay.show.words import words

KINDS: Mapping[str, str] = {
    "copper_dc": "copper DC",
    "copper_ac": "copper AC",
    "iron": "iron",
    "magnet": "magnets",
    "mechanical": "bearings and windage",
    "other": "other",
}
BANDS = {  # where a hot spot's band is from -> what it holds
    "calibration": "; 95 %, by what its calibration left unknown of the model, not by errors of its form",
    "motor file": "; 95 %, by the sd of the motor file: calibrate it for a narrower one",
}
SMALL = 0.005  # of the whole: parts below are not told
AnySpot = ModelledSpot | SmoothedSpot


def heat(summary: Summary) -> str | None:
    """Where heat came from and where it went, and the efficiency; None of runs without an account or any heat."""
    losses = summary.losses
    if losses is None or losses.energy_J <= 0:
        return None
    whole = losses.energy_J
    parts = sorted(losses.kinds.items(), key=lambda item: -item[1].energy_J)
    shares = {kind: part.energy_J / whole for kind, part in parts if abs(part.energy_J) > SMALL * whole}
    made = ", ".join(f"{KINDS[kind]} {100 * share:.0f} %".replace("-", "−") for kind, share in shares.items())
    gone = [f"{_watts(part.mean_W)} into {words.name(name)}" for name, part in losses.boundaries.items()]
    gone.append(f"{_watts(losses.stored_J / summary.duration_s)} stored")
    return f"{_watts(losses.mean_W)} of heat on average ({made}): {words.joined(gone)}{_efficiency(summary)}"


def _watts(value: float) -> str:
    return f"{words.number(round(value) if abs(value) >= 10 else value)} W".replace("-", "−")


def _efficiency(summary: Summary) -> str:
    found = summary.efficiency
    if found is None:
        return ""
    modelled = f"; efficiency {100 * found.modelled:.1f} % by the model"
    if found.measured is None:
        return modelled
    cannot_be = " (no motor has that: torque, speed or electrical power is read wrong)" if found.measured > 1 else ""
    return f"{modelled}, {100 * found.measured:.1f} % as recorded{cannot_be}"


def hottest(summary: Summary) -> str | None:
    """The hottest winding and magnet, how sure, where and when; None where the run has neither."""
    found = summary.hot_spots
    held = next((BANDS[one.band_from] for one in found.values() if one.band_from), "")
    return f"hottest by the model: {spots(found)}{held}" if found else None


def spots(found: Mapping[str, AnySpot]) -> str:
    """Hot spots with their bands: "winding 130 °C (120 to 140) at 0:00:01 (30.0 K ABOVE its limit)" and the magnet."""
    return words.joined([_spot(spot, one) for spot, one in sorted(found.items(), reverse=True)])


def in_brief(summary: Summary) -> list[str]:
    """Winding and magnet with their bands, the one with the least margin first, then other nodes above their limits:
    "winding 171 °C (150 to 192), 9.0 K under its limit"."""
    ranked = sorted(summary.hot_spots.items(), key=lambda item: _urgent(item[1]))
    told = [_degrees(_called(spot, one), one) + _beside_limit(one.margin_K) for spot, one in ranked]
    spots = {one.node for one in summary.hot_spots.values()}
    above = {node: one for node, one in summary.limits.items() if one.above_s > 0 and node not in spots}
    return told + [
        f"{words.name(node)} {one.max_degC:.0f} °C{_beside_limit(one.limit_degC - one.max_degC)}"
        for node, one in above.items()
    ]


def _called(spot: str, one: AnySpot) -> str:
    """Where no place is told beside: a motor of which no node is called so may have no magnet."""
    return spot if spot in one.node else words.name(one.node)


def _urgent(one: AnySpot) -> tuple[float, float]:
    return math.inf if one.margin_K is None else one.margin_K, -one.max_degC


def _beside_limit(margin_K: float | None) -> str:
    return "" if margin_K is None else f", {margin(margin_K)}"


def _spot(spot: str, one: AnySpot) -> str:
    place = f"({_place(spot, one)}{margin(one.margin_K)})"
    return f"{_degrees(spot, one)} at {clock(one.at_s)} {place}"


def _degrees(spot: str, one: AnySpot) -> str:
    band = " ({:.0f} to {:.0f})".format(*one.ci95_degC) if one.ci95_degC else ""
    return f"{spot} {one.max_degC:.0f} °C{band}"


def _place(spot: str, one: AnySpot) -> str:
    place = "" if one.node == spot else f"{words.name(one.node)}, "
    if top := one.profile:
        place += f"up to {top.max_degC:.0f} °C {top.slices:.1f} slices towards {words.name(top.towards)}, "
    return place


def margin(margin_K: float | None) -> str:
    """ "12.0 K under its limit", "3.1 K ABOVE its limit"."""
    if margin_K is None:
        return "no limit given"
    return f"{words.kelvin(abs(margin_K))} {'under' if margin_K >= 0 else 'ABOVE'} its limit"


def aged(summary: Summary) -> Iterator[str]:
    """A sentence for each group of places that earlier heat has aged: how hot, how long, what is left."""
    for one in summary.ageing:
        left = f"{100 * one.factor:.0f} % of {words.joined([words.name(place) for place in one.places])}"
        by = "the law of the motor file" if one.from_ == LAW else f"the checks of assessment {words.short(one.from_)}"
        yield f"aged: {one.dose_h:.0f} h above {one.above_degC:g} °C before leave {left}, by {by}"


def above_limits(summary: Summary) -> list[str]:
    """A sentence for each node of the model that was above its limit."""
    return [
        f"{words.name(node)}, by the model, is above its limit of {one.limit_degC:g} °C for "
        f"{words.duration(one.above_s)}, up to {one.max_degC:.0f} °C"
        for node, one in summary.limits.items()
        if one.above_s > 0
    ]


def derating(summary: Summary) -> list[str]:
    """A sentence or two for each strategy of the bench file."""
    return [_strategy(one) for one in summary.derating]


def _strategy(one: DeratingCourse) -> str:
    head = f"Derating by {one.channel} ({one.begin_degC:g} to {one.end_degC:g} °C)"
    own = _course(one.seconds, one.mean, one.lowest)
    best = _course(one.seconds_hot, one.mean_hot, one.lowest_hot)
    text = f"{head}: {own}; by the hottest {one.protects} of the model {best}."
    if one.late_s > 0:
        text += f" For {words.duration(one.late_s)} the hot spot asks for less current and the sensor does not."
    if one.hottest_free_degC is not None:
        free = f"{one.hottest_free_degC:.0f} °C{_beside_limit(one.margin_K)}"
        text += f" With full current allowed the hot spot reaches {free}."
    return text


def _course(seconds: float, mean: float, lowest: float) -> str:
    if seconds == 0:
        return "full current throughout"
    share = f"{100 * mean:.0f} % of the current on average and {100 * lowest:.0f} % at least"
    return f"less for {words.duration(seconds)}, {share}"


def meter(one: MeterErrors) -> str:
    """ "P_dc 35 W of 1,240 W (model too low)", or "(within its floor)"."""
    way = "within its floor" if one.within_floor else "model too low" if one.bias > 0 else "model too high"
    return f"{one.channel} {quantity(one.mae, one.unit)} of {quantity(one.mean, one.unit)} ({way})"


def quantity(value: float, unit: str) -> str:
    """A number with its unit, three digits: "12.5 mΩ", "1,240 W"."""
    small, symbol = unit in ("ohm", "Wb") and abs(value) < 0.1, as_written(unit)
    number, shown = (value * 1e3, "m" + symbol) if small else (value, symbol)
    return f"{words.digits(number)} {shown}"
