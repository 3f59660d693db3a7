"""One test of a model on its own: what belongs to a single test is found without running the others."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from twin.fitting.model import Index, Model, Test


def alone(model: Model, number: int, test: Test) -> tuple[Model, Index]:
    """The model of one test, standing as `test` in place of test `number`, and the places (p,) of its parameters in the
    model's vector."""
    at = [p for p, one in enumerate(model.parameters) if one.test in (None, number)]
    own = [model.parameters[p] for p in at]
    own = [one if one.test is None else replace(one, test=0) for one in own]
    return Model(model.network, [test], own, model.noise), np.array(at, dtype=np.intp)
