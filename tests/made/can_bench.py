"""A small test bench on CAN: a motor whose truth is integrated by scipy, logged to BLF or ASC with a DBC, as a user
would.

Nothing of `twin` is used here: the network's equations are written out by hand.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import can
import numpy as np
from cantools.database.can import Database
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

START = 1_760_000_000.0  # 2025-10-09 08:53:20 UTC
ALPHA = 0.00393

MOTOR = """\
schema = "whyhot.motor/1"
name = "servo-5kW"
[scale]
speed_rpm = 6000.0
current_A = 20.0
[[node]]
name = "winding"
capacity = 900.0
[[node]]
name = "yoke"
capacity = 3500.0
[[node]]
name = "magnet"
capacity = 1200.0
[[boundary]]
name = "coolant"
[[link]]
between = ["winding", "yoke"]
terms = [{coefficient = 12.0}]
[[link]]
between = ["yoke", "coolant"]
terms = [{coefficient = 25.0}]
[[link]]
between = ["yoke", "magnet"]
terms = [{coefficient = 1.0}, {coefficient = 2.0, speed = 0.8}]
[[source]]
node = "winding"
terms = [{coefficient = 240.0, current = 2.0, copper = true}]
[[source]]
node = "yoke"
terms = [{coefficient = 90.0, speed = 1.5}]
[[source]]
node = "magnet"
terms = [{coefficient = 30.0, speed = 2.0}]
"""

DBC = """\
VERSION ""
NS_ :
BS_:
BU_: Bench
BO_ 256 Drive: 8 Bench
 SG_ MotorSpeed : 0|16@1- (1,0) [-32768|32767] "rpm" Vector__XXX
 SG_ MotorTorque : 16|16@1- (0.01,0) [-327|327] "Nm" Vector__XXX
 SG_ PhaseCurrent : 39|16@0+ (0.01,0) [0|655] "A" Vector__XXX
BO_ 512 Temps: 8 Bench
 SG_ TC_winding : 0|16@1- (0.01,0) [-100|300] "degC" Vector__XXX
 SG_ TC_yoke : 16|16@1- (0.01,0) [-100|300] "degC" Vector__XXX
 SG_ TC_magnet : 32|16@1- (0.01,0) [-100|300] "degC" Vector__XXX
 SG_ TC_coolant : 48|16@1- (0.01,0) [-100|300] "degC" Vector__XXX
"""

BENCH = """\
schema = "whyhot.bench/1"
motor = "motor.toml"
specimen = "servo-01"
[[channel]]
signal = "MotorSpeed"
quantity = "speed"
unit = "rpm"
[[channel]]
signal = "MotorTorque"
quantity = "torque"
unit = "Nm"
[[channel]]
signal = "PhaseCurrent"
quantity = "current"
unit = "A"
[[channel]]
signal = "TC_winding"
quantity = "temperature"
unit = "degC"
node = "winding"
[[channel]]
signal = "TC_yoke"
quantity = "temperature"
unit = "degC"
node = "yoke"
[[channel]]
signal = "TC_magnet"
quantity = "temperature"
unit = "degC"
node = "magnet"
[[channel]]
signal = "TC_coolant"
quantity = "temperature"
unit = "degC"
node = "coolant"
"""

Floats = NDArray[np.float64]


def write_files(folder: Path) -> None:
    """motor.toml, bench.toml and bench.dbc as a user has them."""
    for name, text in (("motor.toml", MOTOR), ("bench.toml", BENCH), ("bench.dbc", DBC)):
        (folder / name).write_text(text, encoding="utf-8")


def drive(seconds: int, seed: int) -> tuple[Floats, Floats]:
    """Speed [rpm] and current [A rms] at 10 Hz: plateaus of 20 to 90 s, the same for the same seed."""
    random = np.random.default_rng(seed)
    speed, current = np.empty(0), np.empty(0)
    while speed.size < 10 * seconds:
        samples = int(random.integers(200, 900))
        speed = np.append(speed, np.full(samples, np.round(random.uniform(0, 6000))))
        current = np.append(current, np.full(samples, np.round(random.uniform(0, 25), 2)))
    return speed[: 10 * seconds], current[: 10 * seconds]


def truth(
    speed: Floats, current: Floats, coolant: float, magnet_loss: float = 30.0, in_magnet_W: Floats | None = None
) -> Floats:
    """Temperatures (seconds + 1, 3) of winding, yoke, magnet each second, from 25 degC, inputs held for 0.1 s.
    `in_magnet_W`: a heat in the magnet besides."""
    more_W = np.zeros(speed.size) if in_magnet_W is None else in_magnet_W

    def slope(n: float, i: float, more: float) -> Callable[[float, Floats], list[float]]:
        s, c, gap = n / 6000.0, i / 20.0, 1.0 + 2.0 * (n / 6000.0) ** 0.8

        def rate(_: float, t: Floats) -> list[float]:
            copper = 240.0 * c * c * (1 + ALPHA * (t[0] - 20.0))
            return [
                (copper + 12.0 * (t[1] - t[0])) / 900.0,
                (90.0 * s**1.5 + 12.0 * (t[0] - t[1]) + 25.0 * (coolant - t[1]) + gap * (t[2] - t[1])) / 3500.0,
                (magnet_loss * s * s + more + gap * (t[1] - t[2])) / 1200.0,
            ]

        return rate

    temperatures = np.empty((speed.size // 10 + 1, 3))
    temperatures[0] = 25.0
    edges = np.flatnonzero((np.diff(speed) != 0) | (np.diff(current) != 0) | (np.diff(more_W) != 0)) + 1
    state, at = temperatures[0].copy(), 0
    for end in [*edges.tolist(), speed.size]:
        whole = np.arange(-(-at // 10), end // 10 + 1)
        times = np.unique(np.append(whole / 10.0 * 10.0, end / 10.0))
        solved = solve_ivp(
            slope(speed[at], current[at], more_W[at]),
            (at / 10.0, end / 10.0),
            state,
            t_eval=times[times >= at / 10.0],
            rtol=1e-9,
            atol=1e-9,
        )
        for second, value in zip(solved.t, solved.y.T, strict=True):
            if abs(second - round(second)) < 1e-9:
                temperatures[round(second)] = value
        state, at = solved.y[:, -1], end
    return temperatures


def write_log(path: Path, seconds: int = 600, seed: int = 1, start: float = START, magnet_loss: float = 30.0) -> int:
    """Write a session to `path` (.blf or .asc); returns the number of frames."""
    database = Database()
    database.add_dbc_string(DBC)
    speed, current = drive(seconds, seed)
    coolant = 30.0
    temperatures = truth(speed, current, coolant, magnet_loss)
    frames = 0
    with can.Logger(str(path)) as log:
        for k in range(10 * seconds):
            values = {"MotorSpeed": speed[k], "MotorTorque": 0.8 * current[k], "PhaseCurrent": current[k]}
            log.on_message_received(_frame(database, "Drive", values, start + 0.1 * k))
            frames += 1
            if k % 10 == 0:
                names = ("TC_winding", "TC_yoke", "TC_magnet")
                values = {**dict(zip(names, temperatures[k // 10], strict=True)), "TC_coolant": coolant}
                log.on_message_received(_frame(database, "Temps", values, start + 0.1 * k))
                frames += 1
    return frames


def _frame(database: Database, message: str, values: dict[str, float], stamp: float) -> can.Message:
    entry = database.get_message_by_name(message)
    return can.Message(
        timestamp=stamp,
        arbitration_id=entry.frame_id,
        is_extended_id=False,
        data=entry.encode(values, strict=False),
        channel=0,
        is_rx=True,
    )
