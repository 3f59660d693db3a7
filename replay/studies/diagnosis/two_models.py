"""What a named cause changes beside the sensors' errors, as the answer says it: recalibrated or extended, how far the
two models are apart and what would tell which is right."""

from __future__ import annotations

from collections.abc import Sequence

from replay.studies.diagnosis import answer
from replay.studies.diagnosis.answer import Telling, TwoModels
from replay.studies.diagnosis.answer_parts import with_unit
from replay.studies.diagnosis.question import Question
from replay.studies.diagnosis.search import Found
from twin.diagnosis import two_models as twin
from twin.diagnosis.in_words import Plain
from twin.diagnosis.next_tests import load_of
from twin.differences.everyday import everyday
from twin.errors import DivergedError
from twin.fitting.model import Test
from twin.motor.network import Network

RELIEVED = 3  # told at most
LEAST_RELIEF = 0.5  # sd that a healthy difference moves back: less is not told


def two_models(question: Question, found: Found, kept: Sequence[Test]) -> TwoModels | None:
    """None where nothing was learnt that a file can say, or where a model runs away."""
    naming = found.naming
    before, after = found.base, naming.final
    if not (found.swaps or naming.map_said or any(refit.candidate.sayable for refit in naming.accepted)):
        return None
    network = before.model.network
    plain = Plain(network)
    sessions, tests = (question.kept, kept) if kept else (question.train, before.model.tests)
    try:
        inside, points = twin.inside(before, after, tests), twin.points(before, after)
    except DivergedError:
        return None
    stated = everyday(network, before.model.tests)
    relief = [one for one in twin.relieved(before, after, stated) if abs(one.before) - abs(one.after) > LEAST_RELIEF]
    unseen = [
        answer.UnseenNode(
            node=one.node, mean_K=one.mean_K, max_K=one.max_K, session=sessions[one.test].session, t_s=one.t_s
        )
        for one in inside
    ]
    return TwoModels(
        over_kept=bool(kept),
        relieved=[
            answer.Relieved(parameter=plain.says(one.parameter), before_sd=one.before, after_sd=one.after)
            for one in relief[:RELIEVED]
        ],
        inside=unseen,
        points=[_point(point, network, load_of(before.model.tests)) for point in points],
        test=_test(points),
        sensor=_sensor(inside, points, twin.usual_floor(before)),
    )


def _point(point: twin.PointApart, network: Network, load: str | None) -> answer.SteadyPoint:
    at = {"speed": point.speed, str(load): point.load}
    node = max(point.nodes, key=lambda name: abs(point.nodes[name]))
    inputs = {with_unit(name): value * network.scale[name] for name, value in at.items()}
    return answer.SteadyPoint(says=point.words, at=inputs, node=node, differ_K=point.nodes[node])


def _test(points: Sequence[twin.PointApart]) -> Telling | None:
    """The point at which a sensor reads furthest apart for what it may be off."""
    readings = [(one, point.words) for point in points for one in point.readings]
    best, words = max(readings, key=lambda pair: pair[0].times, default=(None, ""))
    if best is None or best.times < twin.TELLS:
        return None
    return Telling(says=words, node=best.node, channel=best.name, differ_K=best.differ_K, times_sensor=best.times)


def _sensor(inside: Sequence[twin.NodeApart], points: Sequence[twin.PointApart], floor_K: float) -> Telling | None:
    """The node without a sensor that is furthest apart, in the mean of the sessions or at a point, for what a sensor
    there may be off."""
    apart = [(one.node, one.mean_K, "") for one in inside]
    apart += [(one.node, point.nodes[one.node], point.words) for one in inside for point in points]
    node, differ_K, words = max(apart, key=lambda one: abs(one[1]), default=("", 0.0, ""))
    if abs(differ_K) < twin.TELLS * floor_K:
        return None
    return Telling(says=words, node=node, channel=None, differ_K=differ_K, times_sensor=abs(differ_K) / floor_K)
