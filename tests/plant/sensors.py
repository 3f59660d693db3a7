"""What the bench records of a session: mixtures of cells, seen late, with noise, bias, steps, holds, lost frames,
clocks.

A recording is messages: stamps [ns since the epoch] and physical values as they stand in the frames.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from plant.effects import Effect
from plant.forms import JACKETED, Form
from plant.mesh import Mesh
from plant.plant import Plant, Truth
from plant.thermocouples import SENSORS, Sensor

Floats = NDArray[np.float64]
Times = NDArray[np.int64]

LAG_s, LAG_SD_s = 2.0, 0.25
NOISE_K, STEP_K, BIAS_SD_K, GAIN_SD = 0.1, 0.1, 0.3, 0.004
INPUT_GAIN_SD = {"speed": 0.0003, "current": 0.005, "torque": 0.003, "power": 0.003, "flow": 0.01}
INPUT_NOISE = {"speed": 1.5, "current": 0.8, "torque": 0.4, "power": 60.0, "flow": 0.03}
INLET_BIAS_SD_K, AMBIENT_BIAS_SD_K = 0.2, 0.5
DROPPED, JITTER_s = 0.01, 0.003
HOLDS_PER_HOUR, HOLD_s = 2.0, (6.0, 20.0)  # of the radio link
CLOCK_SD_s = 0.05
EPOCH_NS = 1_760_000_000 * 10**9  # 2025-10-09 08:53:20 UTC; sessions are a day apart
DAY_NS = 86_400 * 10**9


LAYOUTS = {
    "paper": ("EW_A_inner", "EW_B_inner", "RS", "MAG"),
    "six": ("EW_A_inner", "EW_B_inner", "TC_teeth", "TC_yoke", "RS", "MAG"),
    "ten": tuple(sensor.signal for sensor in SENSORS),
}


@dataclass(frozen=True)
class Message:
    """`name`, CAN `identifier`, `bus` (1, 2), `signals`: name, unit, factor of the last digit, and whether
    big-endian."""

    name: str
    identifier: int
    bus: int
    signals: tuple[tuple[str, str, float], ...]
    motorola: bool = False


@dataclass(frozen=True)
class Block:
    """The frames of one message: `t_ns` (M,) ascending, `values` (M, signals)."""

    message: Message
    t_ns: Times
    values: Floats


@dataclass(frozen=True)
class Recording:
    """What the bench recorded of a session, and the truth behind it. `errors`: signal -> the everyday gain [1] and bias
    [K] of that sensor."""

    name: str
    kind: str
    blocks: tuple[Block, ...]
    truth: Truth
    errors: Mapping[str, tuple[float, float]]


DRIVE = Message(
    "Drive", 0x100, 1, (("Speed", "rpm", 0.5), ("Torque", "Nm", 0.02), ("Id", "A", 0.05), ("Iq", "A", 0.05))
)
SUPPLY = Message("Supply", 0x110, 1, (("Power", "W", 10.0), ("TorqueCommand", "Nm", 0.05)), motorola=True)
COOLANT = Message(
    *("Coolant", 0x200, 1),
    (("Inlet", "degC", 0.1), ("Outlet", "degC", 0.1), ("Ambient", "degC", 0.1), ("Flow", "l/min", 0.01)),
)


def sensors(layout: str, form: Form = JACKETED) -> tuple[Sensor, ...]:
    """The sensors of a layout in a motor of this form, in the order of SENSORS."""
    return tuple(sensor for sensor in form.sensors if sensor.signal in LAYOUTS[layout])


def messages(layout: str) -> tuple[Message, ...]:
    """The messages of a bench with this layout: four thermocouples in each frame on the second bus, the radio's
    apart."""
    chosen = sensors(layout)
    wired = [sensor.signal for sensor in chosen if not sensor.radio]
    frames = [
        Message(f"Stator{i // 4 + 1}", 0x210 + i // 4, 2, tuple((s, "degC", STEP_K) for s in wired[i : i + 4]))
        for i in range(0, len(wired), 4)
    ]
    radio = tuple((sensor.signal, "degC", STEP_K) for sensor in chosen if sensor.radio)
    return DRIVE, SUPPLY, COOLANT, *frames, Message("Telemetry", 0x220, 2, (*radio, ("Counter", "1", 1.0)))


def record(plant: Plant, truth: Truth, layout: str = "six") -> Recording:
    """The recording of a session; every imperfection is drawn from the plant's seed and the session's number."""
    random = plant.random(2, truth.number)
    drive = truth.drive
    fast, slow = drive.rate_hz, min(drive.rate_hz, 2.0)
    columns: dict[str, Floats] = {}
    times: dict[float, Floats] = {rate: np.arange(round(drive.seconds * rate)) / rate for rate in {fast, slow}}
    columns |= _inputs(plant, truth, random, times[fast], times[slow])
    readings, errors = _temperatures(plant, truth, random, times[slow], layout)
    columns |= readings
    blocks = []
    for place, message in enumerate(messages(layout)):
        t = times[fast] if message in (DRIVE, SUPPLY) else times[slow]
        if message.name == "Telemetry":
            columns["Counter"] = np.arange(t.size, dtype=np.float64) % 4096.0
        values = np.stack([columns[name] for name, _, _ in message.signals], axis=1)
        if message.name == "Telemetry":
            _hold(values, _silences(plant.roughness, random, t), t)
        blocks.append(_sent(plant, message, t, values, plant.random(7, truth.number, place), truth.number))
    return Recording(drive.name, drive.kind, tuple(blocks), truth, errors)


# ---- inputs --------------------------------------------------------------------------------------------------------


def _inputs(plant: Plant, truth: Truth, random: np.random.Generator, fast: Floats, slow: Floats) -> dict[str, Floats]:
    """Speed, torque, currents, power and flow as measured; inlet, outlet, ambient as felt."""
    drive, point = truth.drive, truth.point
    gain = {name: 1.0 + sd * random.standard_normal() for name, sd in INPUT_GAIN_SD.items()}
    shift = dict.fromkeys(gain, 0.0)
    for effect in plant.effects:
        if effect.kind == "input" and effect.law == "gain":
            gain[effect.place] *= 1.0 + effect.size
        if effect.kind == "input" and effect.law == "bias":
            shift[effect.place] += effect.size
    steps = np.minimum((fast / (truth.t_s[1] - truth.t_s[0])).astype(np.int64), truth.heat.size - 1)
    power = point.torque * drive.speed_rpm * np.pi / 30 + truth.heat[steps]
    moving = drive.speed_rpm != 0.0

    def measured(name: str, values: Floats, on: NDArray[np.bool_] | None = None) -> Floats:
        noise = INPUT_NOISE[name] * random.standard_normal(values.size)
        return values * gain[name] + (noise if on is None else noise * on) + shift[name]

    current = (1.0 + shift["current"] / np.maximum(point.current, 1.0)) * gain["current"]
    live = point.current > 0.0
    pick = np.minimum((slow * drive.rate_hz).round().astype(np.int64), drive.samples - 1)
    index = plant.mesh.index
    outlet = np.interp(slow, truth.t_s, truth.temperatures[:, index[plant.mesh.coolant[-1]]])
    bias = {
        b: float(sum(e.size for e in plant.effects if e.kind == "boundary" and e.place == b))
        for b in ("coolant", "ambient")
    }
    return {
        "Speed": measured("speed", drive.speed_rpm, moving),
        "Torque": measured("torque", point.torque),
        "Id": point.i_d * current + live * INPUT_NOISE["current"] * random.standard_normal(fast.size),
        "Iq": point.i_q * current + live * INPUT_NOISE["current"] * random.standard_normal(fast.size),
        "Power": measured("power", power),
        "TorqueCommand": drive.torque_Nm,
        "Inlet": drive.inlet_degC[pick]
        + INLET_BIAS_SD_K * random.standard_normal() + bias["coolant"] + _white(random, slow),
        "Outlet": outlet + INLET_BIAS_SD_K * random.standard_normal() + _white(random, slow),
        "Ambient": drive.ambient_degC[pick]
        + AMBIENT_BIAS_SD_K * random.standard_normal() + bias["ambient"] + _white(random, slow),
        "Flow": np.maximum(measured("flow", drive.flow_lpm[pick], drive.flow_lpm[pick] > 0), 0.0),
    }  # fmt: skip


def _white(random: np.random.Generator, t: Floats) -> Floats:
    return NOISE_K * random.standard_normal(t.size)


# ---- temperatures --------------------------------------------------------------------------------------------------


def _temperatures(
    plant: Plant, truth: Truth, random: np.random.Generator, t: Floats, layout: str
) -> tuple[dict[str, Floats], dict[str, tuple[float, float]]]:
    """Signal -> readings (M,), and -> everyday gain and bias. A specimen's sensors sit where its seed says, in every
    session."""
    place, mine = plant.random(8), LAYOUTS[layout]
    readings: dict[str, Floats] = {}
    errors: dict[str, tuple[float, float]] = {}
    for sensor in plant.form.sensors:  # all of them are drawn, so that a layout does not change the others
        cells, weights = _place(plant.mesh, sensor, place, plant.roughness)
        lag = LAG_s + plant.roughness * LAG_SD_s * float(place.standard_normal())
        gain = 1.0 + plant.roughness * GAIN_SD * float(place.standard_normal())
        bias = plant.roughness * BIAS_SD_K * float(random.standard_normal())
        noise = _white(random, t)
        if sensor.signal in mine:
            effects = [e for e in plant.effects if e.kind == "sensor" and e.place == sensor.node]
            errors[sensor.signal] = gain - 1.0, bias
            readings[sensor.signal] = _read(truth, truth.at(cells, weights), t, lag, gain, bias, effects) + noise
    _faults(plant.effects, {s.node: s for s in sensors(layout)}, readings, t, plant.random(9, truth.number))
    return readings, errors


def _place(
    mesh: Mesh, sensor: Sensor, random: np.random.Generator, roughness: float
) -> tuple[NDArray[np.intp], Floats]:
    """Cells and weights of a sensor: as designed, each weight off by 30 %."""
    index, marks = mesh.index, {"m": mesh.axial // 2, "e": mesh.axial - 1}
    cells = np.array([index[stem.format(**marks)] for stem, _ in sensor.cells], np.intp)
    off = np.exp(0.3 * roughness * random.standard_normal(len(cells)))
    return cells, np.array([weight for _, weight in sensor.cells]) * off


def _read(
    truth: Truth, place: Floats, t: Floats, lag: float, gain: float, bias: float, effects: list[Effect]
) -> Floats:
    """What a sensor shows (M,) before noise and faults: the place's temperature through lag, stem, gain, bias and
    drift."""
    size = {law: sum(e.size for e in effects if e.law == law) for law in ("lag", "gain", "bias", "drift", "stem")}
    ambient = np.interp(truth.t_s, np.arange(truth.drive.samples) / truth.drive.rate_hz, truth.drive.ambient_degC)
    felt = place + size["stem"] * (ambient - place)
    seen = np.interp(t, truth.t_s, lagged(felt, lag + size["lag"], float(truth.t_s[1])))
    return seen * gain * (1.0 + size["gain"]) + bias + size["bias"] + size["drift"] * t / 3600.0


def lagged(values: Floats, tau_s: float, step_s: float) -> Floats:
    """Values through a first-order lag, exact where they are linear within a step."""
    a = np.exp(-step_s / tau_s)
    ramp = (1.0 - a) * tau_s / step_s
    result: Floats = values[0] + lfilter([1.0 - ramp, ramp - a], [1.0, -a], values - values[0])
    return result


def _faults(
    effects: tuple[Effect, ...],
    by_node: dict[str, Sensor],
    readings: dict[str, Floats],
    t: Floats,
    random: np.random.Generator,
) -> None:
    """Put swaps, saturation, a stuck last part and held stretches of wired sensors into the readings."""
    for effect in effects:
        if effect.kind != "sensor" or effect.place not in by_node:
            continue
        signal = by_node[effect.place].signal
        if effect.law.startswith("swap_"):
            other = by_node[effect.law.removeprefix("swap_")].signal
            readings[signal], readings[other] = readings[other], readings[signal]
        if effect.law == "saturation":
            readings[signal] = np.minimum(readings[signal], effect.size)
        if effect.law == "stuck":
            first = round((1.0 - effect.size) * t.size)
            readings[signal][first:] = readings[signal][first]
        if effect.law == "hold":
            for begin, end in _stretches(random, t, effect.size):
                readings[signal][begin:end] = readings[signal][begin]


def _stretches(random: np.random.Generator, t: Floats, share: float, length_s: float = 90.0) -> list[tuple[int, int]]:
    """Stretches of about `length_s` that hold `share` of the time together."""
    size = max(round(length_s * t.size / max(t[-1], 1.0)), 2)
    slots = np.arange(0, t.size - size, size)
    chosen = random.choice(slots, max(round(share * slots.size), 1), replace=False)
    return [(int(begin), int(begin) + size) for begin in sorted(chosen)]


def _silences(roughness: float, random: np.random.Generator, t: Floats) -> list[tuple[float, float]]:
    """Everyday silences of the radio [s]: its last values are repeated."""
    count = int(random.poisson(roughness * HOLDS_PER_HOUR * t[-1] / 3600.0))
    return [(float(begin), float(begin + random.uniform(*HOLD_s))) for begin in random.uniform(0.0, t[-1], count)]


def _hold(values: Floats, silences: list[tuple[float, float]], t: Floats) -> None:
    """Repeat the values at the begin of each silence, the counter too."""
    for begin, end in silences:
        first, last = np.searchsorted(t, (begin, end))
        values[first:last] = values[min(first, len(t) - 1)]


# ---- frames and clocks ---------------------------------------------------------------------------------------------


def _sent(plant: Plant, message: Message, t: Floats, values: Floats, random: np.random.Generator, number: int) -> Block:
    """The frames of a message, with steps of the converter, lost frames, jitter, and the clock of the bus."""
    rough = plant.roughness
    keep = random.random(t.size) >= rough * DROPPED
    lost = {e.place: e.size for e in plant.effects if e.kind == "sensor" and e.law == "dropout"}
    nodes = {sensor.signal: sensor.node for sensor in SENSORS}
    for name, _, _ in message.signals:
        if nodes.get(name) in lost:
            keep &= random.random(t.size) >= lost[nodes[name]]
    skew = rough * CLOCK_SD_s * float(plant.random(10, number).standard_normal()) if message.bus == 2 else 0.0
    rate = 0.0
    for effect in plant.effects:
        if effect.kind == "clock" and effect.place == f"can{message.bus}":
            skew += effect.size if effect.law == "offset" else 0.0
            rate += effect.size * 1e-6 if effect.law == "drift" else 0.0
    late = t * (1.0 + rate) + skew + np.abs(rough * JITTER_s * random.standard_normal(t.size))
    stamps = np.maximum.accumulate((late * 1e9).astype(np.int64))
    steps = np.array([factor for _, _, factor in message.signals])
    shown = np.clip(np.round(values / steps), -32768, 32767) * steps
    start = EPOCH_NS + number * DAY_NS + 10**9
    return Block(message, start + stamps[keep], shown[keep])
