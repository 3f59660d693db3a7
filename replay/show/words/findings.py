"""What the summaries of runs say, in sentences: how far off, which way, where, and whether the sensor can tell."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from replay.engine.results.summary import ChannelErrors, Summary
from replay.show.words import words

ONE_SIDED = 0.7  # share of the mean error that the bias must reach to be called one-sided
BALANCES = 3  # sessions of which a power balance is told
MOVED_K = 0.05  # a reading that is corrected by less is told as recorded
AGREE = 0.15  # lost power and the network's heat agree within this share


def worst_first(summary: Summary) -> list[ChannelErrors]:
    """The channels of a run, largest mean error first."""
    return sorted(summary.channels, key=lambda one: -one.mae_K)


def direction(error: ChannelErrors) -> str:
    """Which way the model is off."""
    if abs(error.bias_K) < ONE_SIDED * error.mae_K:
        return "off both ways"
    return "too cold" if error.bias_K > 0 else "too hot"


def mean_error(error: ChannelErrors) -> str:
    """ "4.4 K"; of a reading that the bench file corrects "4.4 K (reading corrected by −1.7 K; as recorded 6.0 K)"."""
    if not is_moved(error):
        return words.kelvin(error.mae_K)
    moved, recorded = words.signed_kelvin(error.reading_moved_K or 0.0), words.kelvin(error.mae_recorded_K or 0.0)
    return f"{words.kelvin(error.mae_K)} (reading corrected by {moved}; as recorded {recorded})"


def is_moved(error: ChannelErrors) -> bool:
    """Whether the bench file corrects the reading by enough to be told."""
    return error.reading_moved_K is not None and abs(error.reading_moved_K) >= MOVED_K


def place_of(one: ChannelErrors, summary: Summary) -> str:
    """Where a channel reads: its node, with its own name where others read there too."""
    shared = sum(other.node == one.node for other in summary.channels) > 1
    return f"{words.name(one.node)} ({one.channel})" if shared else words.name(one.node)


def finding(error: ChannelErrors, summary: Summary) -> str:
    """ "Rotor: model 4.4 K too cold on average, worst at 3,000 to 4,000 rpm"."""
    subject = words.capital(place_of(error, summary))
    if error.within_floor:
        mean, most = mean_error(error), words.kelvin(error.max_K)
        own = words.kelvin(error.floor_K)
        return f"{subject}: {mean} off on average, {most} at worst; the sensor itself leaves {own} open"
    place = words.where(error.where, told=1)
    worst = f"worst {place}" if place else f"{words.kelvin(error.max_K)} at worst"
    return f"{subject}: model {mean_error(error)} {direction(error)} on average, {worst}"


def answer(summaries: Sequence[Summary]) -> str:
    """One sentence: what the model gets wrong on these recordings, and where."""
    found = [(summary, error) for summary in summaries for error in worst_first(summary)]
    errors = [error for _, error in found]
    if not errors:
        return "Nothing can be said: no channel of these recordings observes a node of the model with usable samples."
    wrong = [error for error in errors if not error.within_floor]
    these = "this recording" if len(summaries) == 1 else f"these {len(summaries)} recordings"
    if not wrong:
        floor = words.kelvin(max(error.floor_K for error in errors))
        moved = sum(is_moved(error) for error in errors)
        beside = f", {words.counted(moved, 'reading')} as the bench file corrects it" if moved else ""
        return f"The model agrees with {these} on average within the sensors' own uncertainty ({floor}){beside}."
    ranking = _ranking(found)
    node = max((error.node for error in wrong), key=lambda n: ranking[n])
    at_node = [(summary, error) for summary, error in found if error.node == node and not error.within_floor]
    session, worst = max(at_node, key=lambda one: one[1].mae_K)
    return f"{_worst(session, worst, ranking[node], len(summaries))}{_others(node, ranking, wrong)}"


def _ranking(found: Sequence[tuple[Summary, ChannelErrors]]) -> dict[str, float]:
    """Node -> mean absolute error [K] over channels and sessions, weighted by the sessions' length; largest first."""
    means = {}
    for node in dict.fromkeys(error.node for _, error in found):
        mine = [(summary.duration_s, error.mae_K) for summary, error in found if error.node == node]
        means[node] = sum(mae_K * seconds for seconds, mae_K in mine) / sum(seconds for seconds, _ in mine)
    return dict(sorted(means.items(), key=lambda item: -item[1]))


def _worst(session: Summary, worst: ChannelErrors, mean_K: float, sessions: int) -> str:
    place = words.where(worst.where)
    most = f", most {place}" if place else ""
    verdict = "off both ways" if direction(worst) == "off both ways" else f"mostly {direction(worst)}"
    lead = f"The model is furthest off at the {words.name(worst.node)}: "
    beside = [error for error in worst_first(session) if error.node == worst.node and error is not worst]
    error = mean_error(worst) + (f" ({worst.channel})" if beside else "")
    if sessions == 1:
        return f"{lead}{error} on average and {words.kelvin(worst.max_K)} at worst, {verdict}{most}."
    mean = f"{words.kelvin(mean_K)} on average over {sessions} recordings"
    return f"{lead}{mean}, and {error} in {session.session_name}, its worst ({verdict}{most})."


def _others(node: str, ranking: Mapping[str, float], wrong: Sequence[ChannelErrors]) -> str:
    off = {error.node for error in wrong}
    next_ones = [f"{words.name(n)} {words.kelvin(mean)}" for n, mean in ranking.items() if n in off and n != node]
    fine = [words.name(n) for n in ranking if n not in off]
    told = next_ones[:3] + ([f"{len(next_ones) - 3} more"] if len(next_ones) > 3 else [])
    others = f" Then {words.joined(told)}." if told else ""
    return others + (f" Within the sensors' own uncertainty: {words.joined(fine)}." if fine else "")


def power_balance(summaries: Sequence[Summary]) -> list[str]:
    """Electrical minus mechanical power against the network's heat, where power was recorded: a paragraph a verdict,
    the first few sessions by name."""
    paragraphs: dict[str, list[str]] = {}
    for summary in summaries:
        loss, heat = summary.electrical_minus_mechanical_W, summary.network_heat_W
        if loss is not None:
            ratio = f" ({loss / heat:.1f} times)" if loss > 0 and heat > 0 else ""
            says = f"{summary.session_name} {loss:,.0f} W against {heat:,.0f} W{ratio}"
            paragraphs.setdefault(_verdict(loss, heat), []).append(says)
    lead = "Electrical minus mechanical power against the network's heat, on average"
    return [f"{lead}: {_first(parts)}. {verdict}" for verdict, parts in paragraphs.items()]


def _first(parts: Sequence[str]) -> str:
    more = len(parts) - BALANCES
    return ", ".join(parts[:BALANCES]) + (f" and {more} more" if more > 0 else "")


def _verdict(loss_W: float, heat_W: float) -> str:
    if loss_W <= 0 or heat_W <= 0:
        return "One of them is not positive: check the signs of power, torque and speed in the bench file."
    if loss_W > heat_W * (1 + AGREE):
        return (
            "What the network lacks may be the inverter's loss (where power is measured before it), friction and "
            "windage, an error of the power or torque reading, or heat that the model misses."
        )
    if loss_W < heat_W * (1 - AGREE):
        return (
            "The model makes more heat than was lost: its loss laws are too large here, or the power or torque "
            "reading is off."
        )
    return f"They agree within {100 * AGREE:.0f} %."
