"""What a run's summary says of its filter and smoother, in sentences; and why there is none, or no band."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from replay.engine.results.hot_spot_bands import TOO_LARGE
from replay.show.words import heat_words, words

CHANNELS = 3  # withheld ones, told at most


def filter_says(summary: Mapping[str, Any]) -> Iterator[str]:
    """The loss that was found, how far off that leaves the channels, what else was asked for, and the smoother's hot spots; why there is
    no filter or no band. Nothing of runs that were sealed without these entries."""
    filtered = summary.get("filtered")
    found = loss(summary)
    if found:
        yield found
    worst = compared(summary)[:CHANNELS]
    if worst:
        yield worst[0] if len(worst) == 1 else "; ".join(worst)
    if filtered and filtered.get("unknowns"):
        yield f"asked for: {'; '.join(map(_asked, filtered['unknowns']))}"
    if filtered and filtered.get("hot_spots"):
        yield f"hottest by the smoother: {heat_words.spots(filtered['hot_spots'])}{_held(filtered['hot_spots'])}"
    yield from left_out(summary)


def left_out(summary: Mapping[str, Any]) -> list[str]:
    """Why a run has no band of its hot spots, or no filter; nothing where it has both."""
    spots = summary.get("hot_spots") or {}
    why = next((one["why_no_band"] for one in spots.values() if one.get("why_no_band")), None)
    unfiltered = "filtered" in summary and summary["filtered"] is None
    if unfiltered and why and why.endswith(TOO_LARGE):
        return [f"no band and no filter: {why}"]
    told = [f"no band: {why}"] if why else []
    if unfiltered and spots:
        lacks = "magnet" not in spots
        told.append(
            "no filter: the motor has no magnet and no rotor whose loss it could find"
            if lacks
            else f"no filter: no channel of level {summary['level']} that it may read"
        )
    return told


def compared(summary: Mapping[str, Any]) -> list[str]:
    """A sentence a channel that filter and smoother do not read, furthest off in open loop first; where they read all, of the one that
    is furthest off."""
    filtered, channels = summary.get("filtered"), {c["channel"]: c for c in summary["channels"]}
    if not filtered:
        return []
    kept = _ranked(filtered["mae_K"], channels)
    if kept:
        return [_off(filtered, channels[name], "mae_K", "not read") for name in kept]
    read = _ranked(filtered.get("read_mae_K") or {}, channels)
    return [_off(filtered, channels[name], "read_mae_K", "read, as all are") for name in read[:1]]


def worst_compared(summary: Mapping[str, Any]) -> str | None:
    """The channel that `compared` says first."""
    filtered, channels = summary.get("filtered"), {c["channel"]: c for c in summary["channels"]}
    if not filtered:
        return None
    ranked = _ranked(filtered["mae_K"], channels) or _ranked(filtered.get("read_mae_K") or {}, channels)
    return next(iter(ranked), None)


def _ranked(errors: Mapping[str, float], channels: Mapping[str, Mapping[str, Any]]) -> list[str]:
    return sorted((name for name in errors if name in channels), key=lambda name: -channels[name]["mae_K"])


def _off(filtered: Mapping[str, Any], channel: Mapping[str, Any], key: str, how: str) -> str:
    name, own = channel["channel"], words.name(channel["node"])
    parts = [
        f"open loop {words.kelvin(channel['mae_K'])} off on average",
        f"filter {words.kelvin(filtered[key][name])}",
    ]
    smoothed = filtered.get(f"smoothed_{key}") or {}
    if name in smoothed:
        parts.append(f"smoother {words.kelvin(smoothed[name])}")
    told = how if name == channel["node"] else f"{name}, {how}"
    return f"{own} ({told}): {', '.join(parts)}"


def loss(summary: Mapping[str, Any]) -> str | None:
    """The loss that was found at the node: by the smoother where one ran, else by the filter."""
    filtered = summary.get("filtered")
    heat = (filtered or {}).get("heat")
    if not filtered or not heat:
        return None
    who, best = ("smoother", heat["smoother"]) if heat["smoother"] else ("filter", heat["filter"])
    return (
        f"{who}, from {words.counted(len(filtered['measured']), 'channel')}: {_watts(best['mean_W'])} of loss at the "
        f"{words.name(filtered['node'])} on average (sd {_watts(best['sd_W'])} at any time) and {_watts(best['max_W'])} at most "
        f"(sd {_watts(best['max_sd_W'])}, at {words.clock(best['max_at_s'])}), where the model has {_watts(heat['modelled_mean_W'])}"
    )


def _watts(value: float) -> str:
    return f"{words.number(round(value, 1))} W".replace("-", "−")


def _asked(one: Mapping[str, Any]) -> str:
    numbers = [f"{one[key]:.3g}".replace("-", "−") for key in ("mean", "sd", "min", "max")]
    mean, sd, low, high = numbers
    unit = "" if one["unit"] == "1" else f" {one['unit']}"
    return f"{one['id']} {'times ' if not unit else ''}{mean}{unit} on average (sd {sd}{unit} at any time, {low} to {high}{unit})"


def _held(spots: Mapping[str, Mapping[str, Any]]) -> str:
    """What the smoother's bands hold, and where it has none."""
    checked = sorted({name for one in spots.values() for name in one["checked_by"]})
    bare = [words.name(one["node"]) for one in spots.values() if not one["checked_by"]]
    said = f"; 95 %, by how far it is off {words.joined(checked)} and what these may read too much" if checked else ""
    return said + (f"; no band at {words.joined(bare)}, where no channel could check it" if bare else "")
