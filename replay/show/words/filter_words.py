"""What a run's summary says of its filter and smoother, in sentences; and why there is none, or no band."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from ingest.texts.times import clock
from replay.engine.results.hot_spot_bands import TOO_LARGE
from replay.engine.results.summary import ChannelErrors, FoundUnknown, SmoothedSpot, Summary
from replay.show.words import heat_words, words
from twin.filters.by_filterpy import Apart

CHANNELS = 3  # withheld ones, told at most
ROUNDING_K = 1e-6  # two filters that are the same are no further apart


def filter_says(summary: Summary) -> Iterator[str]:
    """The loss that was found, how far off that leaves the channels, what else was asked for, and the smoother's hot
    spots; why there is no filter or no band. Nothing of runs that were sealed without these entries."""
    filtered, found = summary.filtered, loss(summary)
    if found:
        yield found
    if worst := compared(summary)[:CHANNELS]:
        yield "; ".join(worst)
    if asked := asked_for(summary):
        yield f"asked for: {'; '.join(asked)}"
    if filtered and filtered.hot_spots:
        yield f"hottest by the smoother: {heat_words.spots(filtered.hot_spots)}{_held(filtered.hot_spots)}"
    yield from left_out(summary)


def left_out(summary: Summary) -> list[str]:
    """Why a run has no band of its hot spots, or no filter; nothing where it has both."""
    spots, unfiltered = summary.hot_spots, summary.filtered is None
    why = next((one.why_no_band for one in spots.values() if one.why_no_band), None)
    if unfiltered and why and why.endswith(TOO_LARGE):
        return [f"no band and no filter: {why}"]
    told = [f"no band: {why}"] if why else []
    if unfiltered and spots and "magnet" in spots:
        told.append(f"no filter: no channel of level {summary.level} that it may read")
    elif unfiltered and spots:
        told.append("no filter: the motor has no magnet and no rotor whose loss it could find")
    return told


def checked(checks: Mapping[str, Apart | None]) -> str:
    """How far filterpy's filter is from the runs' own: session name -> that, None where no filter ran."""
    ran = {name: apart for name, apart in checks.items() if apart}
    none = [name for name, apart in checks.items() if not apart]
    told = [f"no filter ran over {words.joined(none)}"] if none else []
    if ran:
        name = max(ran, key=lambda name: max(ran[name].temperature_K, ran[name].sd_K))
        worst = max(ran[name].temperature_K, ran[name].sd_K)
        most = max(apart.temperature_K for apart in ran.values()), max(apart.sd_K for apart in ran.values())
        says = f"filterpy's filter is at most {most[0]:.1g} K from ours, in standard deviations {most[1]:.1g} K"
        of = f" (furthest in {name}, of {len(ran)} sessions)" if len(ran) > 1 else ""
        wrong = "" if worst < ROUNDING_K else "; that is no rounding: report it with whyhot doctor"
        told.insert(0, says + of + wrong)
    return "; ".join(told)


def compared(summary: Summary) -> list[str]:
    """A sentence for each channel that filter and smoother do not read, furthest off in open loop first; where they
    read all, for the one that is furthest off."""
    filtered = summary.filtered
    if not filtered:
        return []
    kept = _ranked(filtered.mae_K, summary)
    if kept:
        return [_off(one, filtered.mae_K, filtered.smoothed_mae_K, "not read by the filter") for one in kept]
    read = _ranked(filtered.read_mae_K, summary)[:1]
    return [
        _off(one, filtered.read_mae_K, filtered.smoothed_read_mae_K, "read by the filter, as all are") for one in read
    ]


def worst_compared(summary: Summary) -> str | None:
    """The channel that `compared` says first."""
    filtered = summary.filtered
    if not filtered:
        return None
    ranked = _ranked(filtered.mae_K, summary) or _ranked(filtered.read_mae_K, summary)
    return ranked[0].channel if ranked else None


def _ranked(errors: Mapping[str, float], summary: Summary) -> list[ChannelErrors]:
    """The channels that have one of these errors, furthest off in open loop first."""
    channels = {one.channel: one for one in summary.channels}
    return sorted((channels[name] for name in errors if name in channels), key=lambda one: -one.mae_K)


def _off(
    open_loop: ChannelErrors, filtered: Mapping[str, float], smoothed: Mapping[str, float] | None, how: str
) -> str:
    name, node = open_loop.channel, open_loop.node
    parts = [f"open loop {words.kelvin(open_loop.mae_K)} off on average", f"filter {words.kelvin(filtered[name])}"]
    if smoothed and name in smoothed:
        parts.append(f"smoother {words.kelvin(smoothed[name])}")
    told = how if name == node else f"{name}, {how}"
    return f"{words.name(node)} ({told}): {', '.join(parts)}"


def loss(summary: Summary) -> str | None:
    """The loss that was found at the node: by the smoother where one ran, else by the filter."""
    filtered = summary.filtered
    if not filtered or not filtered.heat:
        return None
    heat = filtered.heat
    who, best = ("smoother", heat.smoother) if heat.smoother else ("filter", heat.filter)
    channels, node = words.counted(len(filtered.measured), "channel"), words.name(filtered.node)
    mean = f"{_watts(best.mean_W)} of loss at the {node} on average (sd {_watts(best.sd_W)} at any time)"
    most = f"{_watts(best.max_W)} at most (sd {_watts(best.max_sd_W)}, at {clock(best.max_at_s)})"
    return f"{who}, from {channels}: {mean} and {most}, where the model has {_watts(heat.modelled_mean_W)}"


def _watts(value: float) -> str:
    return f"{words.number(round(value, 1))} W".replace("-", "−")


def asked_for(summary: Summary) -> list[str]:
    """What the filter found of each cause that it was asked for."""
    return [_asked(one) for one in summary.filtered.unknowns] if summary.filtered else []


def _asked(one: FoundUnknown) -> str:
    mean, sd, low, high = map(words.digits, (one.mean, one.sd, one.min, one.max))
    unit, times = ("", "times ") if one.unit == "1" else (f" {one.unit}", "")
    return f"{one.id} {times}{mean}{unit} on average (sd {sd}{unit} at any time, {low} to {high}{unit})"


def _held(spots: Mapping[str, SmoothedSpot]) -> str:
    """What the smoother's bands hold, and where it has none."""
    checked = sorted({name for one in spots.values() for name in one.checked_by})
    bare = [words.name(one.node) for one in spots.values() if not one.checked_by]
    said = f"; 95 %, by how far it is off {words.joined(checked)} and what these may read too much" if checked else ""
    return said + (f"; no band at {words.joined(bare)}, where no channel could check it" if bare else "")
