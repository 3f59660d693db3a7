"""Where no sensor sits: what a model says of a node there, against the mean temperature of the plant's own cells."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from benchmarks.trial.campaigns import Course, middles
from replay.studies.diagnosis.search import Found
from twin.errors import DivergedError
from twin.fitting.fit import Fit
from twin.fitting.model import Model, Test
from twin.motor.network import Network

MODELS = ("published", "recalibrated", "extended")
Errors = Mapping[str, float | None]  # of each of MODELS [K]; None where there is none


def at_sensors(found: Found) -> Errors:
    """Mean absolute error of the kept sessions over the observed nodes, as the diagnosis itself measures it."""
    gain = found.kept.gain if found.kept else ()
    if not gain:
        return dict.fromkeys(MODELS)
    errors = [[one.published_mae_K, one.mae_before_K, one.mae_after_K] for one in gain]
    return dict(zip(MODELS, np.mean(errors, axis=0).tolist(), strict=True))


def inside(found: Found, network: Network, kept: Sequence[Test], nodes: Sequence[Course]) -> Errors:
    """Mean absolute error over the nodes without a sensor in the kept sessions, `nodes` their true temperatures.

    The models run as in a replay: nothing is fitted on the kept session."""
    return {
        "published": error_K(None, network, kept, nodes),
        "recalibrated": error_K(found.base, network, kept, nodes),
        "extended": error_K(found.naming.final, network, kept, nodes),
    }


def error_K(fitted: Fit | None, network: Network, kept: Sequence[Test], nodes: Sequence[Course]) -> float | None:
    """Of the file as published where nothing is fitted; None where the model runs away, or every node is observed."""
    pairs = list(zip(fitted.model.parameters, fitted.beta, strict=True)) if fitted else []
    shared = [(p, b) for p, b in pairs if p.test is None]
    model, beta = Model(network, kept, [p for p, _ in shared]), np.array([b for _, b in shared])
    left = []
    for number, (test, truth) in enumerate(zip(kept, nodes, strict=True)):
        try:
            means = model.course(number, beta)[1]
        except DivergedError:
            return None
        observed = {channel.sensor.node for channel in test.channels}
        t = middles(len(means) * test.frame.step_s, test.frame.step_s)
        for node, modelled in zip(network.nodes, means.T, strict=True):
            if node.name not in observed:
                true = np.interp(t, middles(len(truth[node.name])), truth[node.name])
                left.append(np.abs(modelled - true))
    return float(np.concatenate(left).mean()) if left else None
