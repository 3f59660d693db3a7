"""What the summaries of runs say, in sentences: how far off, which way, where, and whether the sensor can tell."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from replay.show.words import words

ONE_SIDED = 0.7  # share of the mean error that the bias must reach to be called one-sided
AGREE = 0.15  # lost power and the network's heat agree within this share


@dataclass(frozen=True)
class ChannelError:
    """One channel of one run: all in K, residual = measured - modelled; `where` as in `replay --json`."""

    session: str
    session_name: str
    duration_s: float
    channel: str
    node: str
    mae_K: float
    max_K: float
    bias_K: float
    floor_K: float
    masked: int
    max_at_s: float
    where: Mapping[str, Sequence[float]]

    @property
    def within_floor(self) -> bool:
        """The mean error is not larger than the channel's own uncertainty."""
        return self.mae_K <= self.floor_K

    @property
    def direction(self) -> str:
        """Which way the model is off."""
        if abs(self.bias_K) < ONE_SIDED * self.mae_K:
            return "off both ways"
        return "too cold" if self.bias_K > 0 else "too hot"


def channel_errors(summary: Mapping[str, Any]) -> list[ChannelError]:
    """The channels of a run's summary, largest mean error first."""
    errors = [
        ChannelError(
            session=summary["session"],
            session_name=summary["session_name"],
            duration_s=summary["duration_s"],
            **{
                key: entry[key]
                for key in ("channel", "node", "mae_K", "max_K", "bias_K", "floor_K", "masked", "max_at_s")
            },
            where=entry["where"],
        )
        for entry in summary["channels"]
    ]
    return sorted(errors, key=lambda e: -e.mae_K)


def finding(error: ChannelError) -> str:
    """ "Rotor: model 4.4 K too cold on average, worst at 3,000 to 4,000 rpm"."""
    subject = words.capital(words.name(error.node))
    if error.within_floor:
        return f"{subject}: model within the sensor's own uncertainty ({words.kelvin(error.mae_K)} of {words.kelvin(error.floor_K)})"
    place = words.where(error.where, told=1)
    worst = f"worst {place}" if place else f"{words.kelvin(error.max_K)} at worst"
    return f"{subject}: model {words.kelvin(error.mae_K)} {error.direction} on average, {worst}"


def answer(summaries: Sequence[Mapping[str, Any]]) -> str:
    """One sentence: what the model gets wrong on these recordings, and where."""
    errors = [error for summary in summaries for error in channel_errors(summary)]
    if not errors:
        return "Nothing can be said: no channel of these recordings observes a node of the model with usable samples."
    wrong = [error for error in errors if not error.within_floor]
    these = "this recording" if len(summaries) == 1 else f"these {len(summaries)} recordings"
    if not wrong:
        floor = words.kelvin(max(error.floor_K for error in errors))
        return f"The model agrees with {these} within the sensors' own uncertainty ({floor})."
    ranking = mean_by_node(errors)
    node = max((error.node for error in wrong), key=lambda n: ranking[n])
    worst = max((error for error in wrong if error.node == node), key=lambda e: e.mae_K)
    return f"{_worst(worst, ranking[node], len(summaries))}{_others(node, ranking, wrong)}"


def mean_by_node(errors: Sequence[ChannelError]) -> dict[str, float]:
    """Node -> mean absolute error [K] over channels and sessions, weighted by the sessions' length; largest first."""
    means = {}
    for node in dict.fromkeys(error.node for error in errors):
        mine = [error for error in errors if error.node == node]
        weight = sum(error.duration_s for error in mine)
        means[node] = sum(error.mae_K * error.duration_s for error in mine) / weight
    return dict(sorted(means.items(), key=lambda item: -item[1]))


def _worst(worst: ChannelError, mean_K: float, sessions: int) -> str:
    place = words.where(worst.where)
    most = f", most {place}" if place else ""
    verdict = "off both ways" if worst.direction == "off both ways" else f"mostly {worst.direction}"
    lead = f"The model is furthest off at the {words.name(worst.node)}: "
    if sessions == 1:
        return (
            f"{lead}{words.kelvin(worst.mae_K)} on average and {words.kelvin(worst.max_K)} at worst, {verdict}{most}."
        )
    return (
        f"{lead}{words.kelvin(mean_K)} on average over {sessions} recordings, and {words.kelvin(worst.mae_K)} in "
        f"{worst.session_name}, its worst ({verdict}{most})."
    )


def _others(node: str, ranking: Mapping[str, float], wrong: Sequence[ChannelError]) -> str:
    off = {error.node for error in wrong}
    next_ones = [f"{words.name(n)} {words.kelvin(mean)}" for n, mean in ranking.items() if n in off and n != node]
    fine = [words.name(n) for n in ranking if n not in off]
    told = next_ones[:3] + ([f"{len(next_ones) - 3} more"] if len(next_ones) > 3 else [])
    others = f" Then {words.joined(told)}." if told else ""
    return others + (f" Within the sensors' own uncertainty: {words.joined(fine)}." if fine else "")


def power_balance(summaries: Sequence[Mapping[str, Any]]) -> list[str]:
    """Electrical minus mechanical power against the network's heat, where power was recorded: a paragraph a verdict."""
    paragraphs: dict[str, list[str]] = {}
    for summary in summaries:
        loss, heat = summary["electrical_minus_mechanical_W"], summary["network_heat_W"]
        if loss is not None:
            ratio = f" ({loss / heat:.1f} times)" if loss > 0 and heat > 0 else ""
            paragraphs.setdefault(_verdict(loss, heat), []).append(
                f"{summary['session_name']} {loss:,.0f} W against {heat:,.0f} W{ratio}"
            )
    return [
        f"Electrical minus mechanical power against the network's heat, on average: {', '.join(parts)}. {verdict}"
        for verdict, parts in paragraphs.items()
    ]


def _verdict(loss_W: float, heat_W: float) -> str:
    if loss_W <= 0 or heat_W <= 0:
        return "One of them is not positive: check the signs of power, torque and speed in the bench file."
    if loss_W > heat_W * (1 + AGREE):
        return (
            "What the network lacks may be the inverter's loss (where power is measured before it), friction and windage, "
            "an error of the power or torque reading, or heat that the model misses."
        )
    if loss_W < heat_W * (1 - AGREE):
        return "The model makes more heat than was lost: its loss laws are too large here, or the power or torque reading is off."
    return f"They agree within {100 * AGREE:.0f} %."
