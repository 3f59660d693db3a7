"""Power balance: electrical power in, mechanical power out, and whether what is lost between them can be true."""

from __future__ import annotations

from collections.abc import Callable, Container, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ingest.catalogue.channels import Aligned, ChannelData, aligned, block_means, find
from ingest.catalogue.operating_points import round_edges

RPM = 2.0 * np.pi / 60.0  # rad/s
BLOCK_s = 30.0  # signs are judged on means of this: one sample of lag between two meters is no finding
PARTS = ("torque", "speed", "electrical power")
DQ = ("voltage_d", "current_d", "voltage_q", "current_q")
DC = ("voltage_dc", "current_dc")
LOADED = 0.05  # share of the largest mechanical power from which a block tells anything of the balance
MEANT = 0.20  # share of it from which a quotient of powers is an efficiency and not the offset of a torque meter
METERS = 0.02  # of the mechanical power: what torque and power meters of a bench agree to
CURRENTS = 0.10  # of a phase current: what it and its d and q parts agree to
IMPOSSIBLE = 0.10  # share of loaded blocks with loss below zero that no transient explains
OPPOSED = 0.50  # share of loaded blocks that take in both powers, as a motor does for moments while it brakes
AMPLITUDES = (0.40, 0.51)  # the quotient where voltages and currents are amplitudes, of a motor of 80 to 102 %
JOULE_PER_KWH = 3.6e6
DQ_POWER = "3 (Ud Id + Uq Iq), rms"
CELLS = 6  # of the efficiency map, each way, at most

Array = NDArray[np.float64]


@dataclass(frozen=True)
class EfficiencyCell:
    """A speed x torque cell: `efficiency` output / input energy, of the motor or (negative power) the generator."""

    speed_rpm: tuple[float, float]
    torque_Nm: tuple[float, float]
    minutes: float
    efficiency: float


@dataclass(frozen=True)
class PowerBalance:
    """Electrical minus mechanical power over a session; energies signed (negative: out of the motor's terminals)."""

    electrical_from: str  # which channels
    electrical_kWh: float
    mechanical_kWh: float
    mean_loss_W: float
    loaded_h: float
    impossible_share: float  # of the loaded time, where the mean loss of 30 s is below zero by over the meters' 2 %
    opposed_share: float  # of the loaded time, where one power is above zero and the other below
    ratio: float | None  # median of mechanical / electrical power where the motor drives under load
    efficiency: tuple[EfficiencyCell, ...]
    possible: bool  # neither share is more than a transient explains, and no amplitude was taken for an rms value
    says: str

    @property
    def amplitudes(self) -> bool:
        """Whether half of the electrical power would be right, as where voltages and currents are amplitudes."""
        least, most = AMPLITUDES
        return self.electrical_from == DQ_POWER and self.ratio is not None and least <= self.ratio <= most


def balance(channels: Sequence[ChannelData]) -> PowerBalance | None:
    """The balance of a session; None where electrical power, torque or speed is not recorded.

    Electrical power is the channel `power`, else 3 (Ud Id + Uq Iq) of rms values [equal to 1.5 (Ud Id + Uq Iq) of peak
    values, amplitude-invariant transform], else voltage_dc current_dc; mechanical power is torque times speed. Samples
    are held on the stamps of the slowest of these channels.
    """
    torque, speed, source = find(channels, "torque"), find(channels, "speed"), _electrical(channels)
    if torque is None or speed is None or source is None:
        return None
    name, used, power_of = source
    grid = aligned([speed, torque, *used])
    return _balance(name, grid, power_of(grid.values[2:])) if len(grid.t_ns) else None


def two_currents(channels: Sequence[ChannelData]) -> str | None:
    """That the channel `current` is no rms value of what `current_d` and `current_q` say, as where one is an amplitude
    and the other is not; None where they agree within CURRENTS, or where only one way is recorded."""
    phase, d, q = (find(channels, name) for name in ("current", "current_d", "current_q"))
    if phase is None or d is None or q is None:
        return None
    whole, *axes = aligned([phase, d, q]).values
    of_axes = np.hypot(*axes)
    loaded = of_axes >= MEANT * np.quantile(of_axes, 0.995, method="higher") if len(of_axes) else np.zeros(0, bool)
    ratio = float(np.median(np.abs(whole[loaded]) / of_axes[loaded])) if loaded.any() and of_axes.any() else 1.0
    if abs(ratio - 1.0) <= CURRENTS:
        return None
    why = 'amplitudes and rms values: check convention = "peak" of each' if _root_2(ratio) else "check unit and scale"
    return f"{phase.spec.name} is {ratio:.2f} times hypot({d.spec.name}, {q.spec.name}) under load: {why}"


def _root_2(ratio: float) -> bool:
    """Whether it is that of an amplitude to its rms value, or the other way round."""
    return any(abs(ratio / root - 1.0) <= CURRENTS for root in (2**0.5, 0.5**0.5))


def lacking(quantities: Container[str | None]) -> list[str]:
    """Which parts of a power balance channels of these quantities do not record."""
    electrical = any(all(one in quantities for one in way) for way in (("power",), DQ, DC))
    there = ("torque" in quantities, "speed" in quantities, electrical)
    return [part for part, recorded in zip(PARTS, there, strict=True) if not recorded]


def _electrical(
    channels: Sequence[ChannelData],
) -> tuple[str, list[ChannelData], Callable[[Sequence[Array]], Array]] | None:
    """What it is called, the channels it needs, and how it comes from their values [W]; None where there is none."""
    if power := find(channels, "power"):
        return f"channel {power.spec.name}", [power], lambda values: values[0]
    dq = [find(channels, name) for name in DQ]
    if all(dq):
        used = [channel for channel in dq if channel]
        return DQ_POWER, used, lambda v: 3.0 * (v[0] * v[1] + v[2] * v[3])
    dc = [channel for name in DC if (channel := find(channels, name))]
    if len(dc) == 2:
        return "DC link voltage x current, inverter losses included", dc, lambda v: v[0] * v[1]
    return None


def _balance(name: str, grid: Aligned, electrical: Array) -> PowerBalance:
    speed_rpm, torque_Nm = grid.values[:2]
    mechanical = torque_Nm * speed_rpm * RPM
    span = (int(grid.t_ns[0]), int(grid.t_ns[-1]))
    into, out = (block_means(grid.t_ns, power, span, BLOCK_s) for power in (electrical, mechanical))
    loaded = _loaded(out)
    driving = loaded & (into > 0.0)
    impossible, opposed = (
        float(np.mean(flags[loaded])) if loaded.any() else 0.0
        for flags in (into - out < -METERS * np.abs(out), into * out < 0.0)
    )
    found = PowerBalance(
        electrical_from=name,
        electrical_kWh=float(electrical @ grid.dt_s) / JOULE_PER_KWH,
        mechanical_kWh=float(mechanical @ grid.dt_s) / JOULE_PER_KWH,
        mean_loss_W=float((electrical - mechanical) @ grid.dt_s) / max(float(grid.dt_s.sum()), 1e-9),
        loaded_h=float(grid.dt_s[_loaded(mechanical)].sum()) / 3600.0 if loaded.any() else 0.0,
        impossible_share=impossible,
        opposed_share=opposed,
        ratio=float(np.median(out[driving] / into[driving])) if driving.any() else None,
        efficiency=_efficiency(electrical, mechanical, speed_rpm, torque_Nm, grid.dt_s),
        possible=impossible <= IMPOSSIBLE and opposed <= OPPOSED,
        says="",
    )
    found = replace(found, possible=found.possible and not found.amplitudes)
    return replace(found, says=_says(found))


def _loaded(mechanical: Array) -> NDArray[np.bool_]:
    """Which powers (N,) [W], of blocks or of samples, tell anything of the balance."""
    power = np.abs(mechanical)
    return power >= max(LOADED * float(np.quantile(power, 0.995)), 1.0)


def _efficiency(
    electrical: Array, mechanical: Array, speed_rpm: Array, torque_Nm: Array, dt_s: Array
) -> tuple[EfficiencyCell, ...]:
    """Efficiency by energy, in the cells where it flows one way for 10 s and more at a power that meters resolve."""
    edges = [round_edges(speed_rpm, CELLS), round_edges(torque_Nm, CELLS)]
    seconds, into, out = (
        np.histogram2d(speed_rpm, torque_Nm, bins=edges, weights=weight * dt_s)[0]
        for weight in (np.ones_like(dt_s), electrical, mechanical)
    )
    least = MEANT * float(np.quantile(np.abs(mechanical), 0.995))
    return tuple(
        EfficiencyCell(
            (float(edges[0][i]), float(edges[0][i + 1])),
            (float(edges[1][j]), float(edges[1][j + 1])),
            float(seconds[i, j]) / 60.0,
            float(out[i, j] / into[i, j] if out[i, j] > 0.0 else into[i, j] / out[i, j]),
        )
        for i, j in np.argwhere((seconds >= 10.0) & (into * out > 0.0) & (np.abs(out) >= least * seconds)).tolist()
    )


def _says(found: PowerBalance) -> str:
    """One sentence: that it balances, or which of sign, scale and convention cannot be true."""
    if found.loaded_h == 0.0:
        return "no mechanical power: nothing to balance"
    if found.possible:
        return (
            f"power balances: {found.electrical_kWh:.2f} kWh in, {found.mechanical_kWh:.2f} kWh at the shaft, "
            f"{found.mean_loss_W:,.0f} W lost on average"
        )
    if found.opposed_share > OPPOSED:
        return (
            f"electrical and mechanical power have opposite signs for {100 * found.opposed_share:.0f} % of the time "
            "under load: torque, speed or power has the wrong sign"
        )
    if found.amplitudes and found.ratio:
        return (
            f"the shaft gives only {100 * found.ratio:.0f} % of the electrical power while driving, and would give "
            f"{200 * found.ratio:.0f} % if voltages and currents are amplitudes: then say so in the bench file, "
            'convention = "peak"'
        )
    share = f"loss is below zero for {100 * found.impossible_share:.0f} % of the time under load"
    if found.ratio is not None and found.ratio > 1.0:
        return (
            f"{share}: the shaft gives {found.ratio:.2f} times the electrical power while driving: "
            "check scale, unit and convention of torque and power"
        )
    advice = "check whether torque and power were recorded at the same moments, and their zeros"
    return f"{share}, but not as a rule: {advice}"
