"""The shipped four-node motor on recordings that its fit has not seen."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from made.places import EXAMPLES
from replay.engine.files.motor_file import read_motor
from twin.compiled.kernel import Compiled, compile_network
from twin.motor.features import evaluate, monomials
from twin.run.simulate import Frame, simulate

SAID_MAE_K = {  # SOURCE.md: yoke, teeth, winding, rotor
    1: (0.69, 0.67, 0.72, 0.65),
    3: (0.53, 1.40, 0.98, 2.30),
    9: (0.70, 0.66, 0.78, 2.78),
    10: (0.88, 0.87, 0.73, 1.14),
    12: (0.65, 0.91, 0.80, 1.55),
}


@pytest.fixture(scope="module")
def motor() -> Compiled:
    return compile_network(read_motor((EXAMPLES / "hust_four_nodes" / "motor.toml").read_bytes(), "motor.toml"))


def _measured(rows: NDArray[np.void]) -> NDArray[np.float64]:
    winding = np.mean([rows[n] for n in ("activewind_1", "activewind_2", "endwind_1", "endwind_2")], axis=0)
    return np.stack([rows["outer_yoke"], rows["slotbottom"], winding, rows["rotor"]], axis=1)


@pytest.mark.parametrize("number", SAID_MAE_K)
def test_the_errors_are_those_that_its_source_says(motor: Compiled, number: int) -> None:
    rows = np.genfromtxt(EXAMPLES / "hust_motor" / f"id_{number}.csv.gz", delimiter=",", names=True)
    steps = len(rows) - 1
    u = {"current": np.hypot(rows["IdFbk"], rows["IqFbk"])[:-1] / 370.0, "speed": np.abs(rows["speed"])[:-1] / 4000.0}
    around = np.stack([rows["water_outlet"], rows["ambient"]], axis=1)[:-1]
    frame = Frame(1.0, evaluate(monomials(motor.network), u, steps), around)
    measured = _measured(rows)
    mae = np.abs(simulate(motor, frame, measured[0]) - measured).mean(axis=0)
    np.testing.assert_allclose(mae, SAID_MAE_K[number], rtol=0, atol=0.02)
    said = (EXAMPLES / "hust_four_nodes" / "SOURCE.md").read_text(encoding="utf-8")
    assert f"| id_{number} | {' | '.join(f'{value:.2f}' for value in SAID_MAE_K[number])} |" in said
