"""A campaign as a user has it: logs beside motor.toml, bench.toml and bench.dbc."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

from plant import logs
from plant.crude import BIAS_SD_K as CRUDE_BIAS_SD_K
from plant.crude import LUMPS
from plant.drives import Drive
from plant.plant import Plant
from plant.rules import CRUDE, RULES
from plant.sensors import NOISE_K, STEP_K, LAG_s, Recording, messages, record, sensors

BIAS_SD_K = 0.5
NOWHERE_ELSE: Mapping[str, Mapping[str, float]] = MappingProxyType({})
INPUTS = (
    ("Speed", "speed", "rpm", ""),
    ("Torque", "torque", "Nm", ""),
    ("TorqueCommand", "torque_command", "Nm", ""),
    ("Id", "current_d", "A", 'convention = "peak"\n'),
    ("Iq", "current_q", "A", 'convention = "peak"\n'),
    ("Power", "power", "W", ""),
    ("Flow", "flow", "l/min", ""),
    ("Inlet", "temperature", "degC", 'node = "coolant"\n'),
    ("Ambient", "temperature", "degC", 'node = "ambient"\n'),
    ("Outlet", "temperature", "degC", 'role = "ignored"\n'),
    ("Counter", "counter", "1", 'role = "ignored"\n'),
)


def bench_toml(
    plant: Plant,
    layout: str = "six",
    weights: Mapping[str, Mapping[str, float]] = NOWHERE_ELSE,
    bias_sd_K: float = BIAS_SD_K,
) -> str:
    """The bench file of one specimen; `weights`: signal -> node -> share, of thermocouples that stand elsewhere than
    at their node."""
    text = f'schema = "whyhot.bench/1"\nmotor = "motor.toml"\nspecimen = "plant-{plant.seed:04d}"\n'
    for signal, quantity, unit, more in INPUTS:
        text += f'\n[[channel]]\nsignal = "{signal}"\nquantity = "{quantity}"\nunit = "{unit}"\n{more}'
    for sensor in sensors(layout):
        shares = weights.get(sensor.signal, {sensor.node: 1.0})
        mixture = ", ".join(f"{node} = {share:g}" for node, share in shares.items())
        where = f'node = "{next(iter(shares))}"' if len(shares) == 1 else f"weights = {{{mixture}}}"
        text += (
            f'\n[[channel]]\nsignal = "{sensor.signal}"\nquantity = "temperature"\nunit = "degC"\n{where}\n'
            f"noise = {NOISE_K}\nbias_sd = {bias_sd_K}\nresolution = {STEP_K}\ntime_constant_s = {LAG_s}\n"
        )
    return text + (
        '\n[[derived]]\nname = "current"\nquantity = "current"\nunit = "A"\nexpression = "hypot(Id, Iq) / sqrt(2)"\n'
    )


def sessions(
    plant: Plant, drives: Sequence[Drive], layout: str = "six", dose_h: Sequence[float] = ()
) -> list[Recording]:
    """Run and record drives one after the other; `dose_h` hours above 180 degC before each."""
    doses = [*dose_h, *[0.0] * (len(drives) - len(dose_h))]
    return [
        record(plant, plant.run(drive, number, dose), layout)
        for number, (drive, dose) in enumerate(zip(drives, doses, strict=True))
    ]


def write_campaign(
    folder: Path,
    plant: Plant,
    sessions: Sequence[Recording],
    formats: Sequence[str] = ("blf",),
    layout: str = "six",
    weights: Mapping[str, Mapping[str, float]] = NOWHERE_ELSE,
    rule: str = "fitted",
) -> list[Path]:
    """Write `motor.toml` (by a rule of RULES or CRUDE), `bench.toml` (`weights` as of `bench_toml`; those of a crude
    file are its lumps), `bench.dbc` and a log of each session in each format (logs.WRITERS), named `<number>_<name>`;
    returns the logs. Raises KeyError for a format or a rule that is not there."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "motor.toml").write_text({**RULES, **CRUDE}[rule](plant.form), encoding="utf-8")
    bias_sd_K = BIAS_SD_K
    if rule in CRUDE:
        of = {node: lump for lump, nodes in LUMPS[rule].items() for node in nodes}
        weights, bias_sd_K = {one.signal: {of[one.node]: 1.0} for one in sensors(layout)}, CRUDE_BIAS_SD_K
    (folder / "bench.toml").write_text(bench_toml(plant, layout, weights, bias_sd_K), encoding="utf-8")
    (folder / "bench.dbc").write_text(logs.dbc(messages(layout)), encoding="utf-8")
    paths = []
    for recording in sessions:
        for form in formats:
            pattern, write = logs.WRITERS[form]
            path = folder / pattern.format(name=f"{recording.truth.number + 1}_{recording.name}")
            write(path, recording)
            paths.append(path)
    return paths
