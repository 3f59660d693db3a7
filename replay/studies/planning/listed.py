"""Tests that have not been run, as set values in CSV files, in place of recorded sessions.

A file has the columns that `whyhot plan --out` writes; rows are corners, between which all goes straight. What is read
where is what the bench file says, and the readings are those of the motor file's own run: they teach nothing, so that
everything that a healthy motor may do is as wide as its prior, and noise as wide as before any data.
"""

from __future__ import annotations

import csv
import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ingest.bench.bench_file import Bench, read_bench
from ingest.bench.resolving import ResolvedChannel, check_nodes, observing, valued
from ingest.catalogue.channels import ChannelData
from ingest.texts.nearest import hint
from ingest.texts.quantities import STORED_UNIT, Conversion
from replay.engine.files.motor_file import read_motor
from replay.engine.files.motor_maps import whole
from replay.engine.frame.frame import column_name
from replay.errors import ReplayDataError
from replay.studies.diagnosis.question import LEAST_S, Campaign, without_tests
from replay.studies.sessions.recorded import STEP_S, test_of_channels, with_meters
from twin.errors import DivergedError, PlanError
from twin.fitting.fit import NEAR_ENOUGH, Fit, fit
from twin.fitting.model import Floats, Model, Test
from twin.fitting.recorded import RecordedMeter
from twin.fitting.supposed import supposing
from twin.motor.configured import configured
from twin.motor.features import QUANTITY, is_flow, monomials, quantity
from twin.motor.network import Network
from twin.motor.sensor_laws import AMBIENT

TIME, STEP = "time_s", "step"  # columns; which step of a day a row is of does not matter here
AMBIENT_degC = 25.0  # where nothing says it
LONGEST_S = 86_400.0
COLDEST_degC = -273.15
BUS = "bench"  # that stamps all channels whose bench file names none


@dataclass(frozen=True)
class Listed:
    """`tests` that have not been run, on the motor of a file (`model`: its id) with the sensors of a bench file."""

    network: Network
    model: str
    bench: Bench
    tests: Mapping[str, Mapping[str, Floats]]  # name -> column -> a value a second


def read_listed(files: Sequence[Path], bench_file: Path, motor: Path | None) -> Listed:
    """The tests of these CSV files; `motor`: a motor file, None for the one that the bench file names. Raises
    ReplayDataError, BenchFileError or MotorFileError, which say what is wrong where."""
    bench = read_bench(_bytes(bench_file), bench_file.name).at(None)
    if motor is None and bench.motor is None:
        raise ReplayDataError(f"{bench_file}: names no motor file: say --motor motor.toml.")
    data = whole(motor or bench_file.parent / str(bench.motor))
    network = configured(read_motor(data, motor.name if motor else str(bench.motor)), None)
    nodes, boundaries = [node.name for node in network.nodes], [boundary.name for boundary in network.boundaries]
    check_nodes(bench, nodes, boundaries)
    tests = {file.stem: _set_values(file, _columns(network)) for file in files}
    if len(tests) < len(files):
        raise ReplayDataError("two of the files of --tests have one name: each test is called by its own.")
    total_s = sum(len(columns[TIME]) for columns in tests.values()) * STEP_S
    if total_s < LEAST_S:
        raise ReplayDataError(
            f"the tests last {total_s / 60:.0f} min together, too short to find a cause: give {LEAST_S / 60:.0f} min."
        )
    return Listed(network, hashlib.sha256(data).hexdigest(), bench, tests)


def listed_campaign(listed: Listed, level: str) -> Campaign:
    """The tests as a plan takes sessions, their readings those of the file's own run. Raises ReplayDataError where a
    test lacks what the motor file needs, `PlanError` where a limit or the model itself does not let it run."""
    loaded = [_channels(listed, name, columns) for name, columns in listed.tests.items()]
    asked = without_tests(listed.network, loaded, level)
    hours = {f: 0.0 for m in monomials(listed.network) for f in m.features if quantity(f) is None}
    tests = []
    for name, channels in zip(listed.tests, loaded, strict=True):
        good = [np.ones(len(channel.t_ns), dtype=np.bool_) for channel in channels]
        try:
            test, frame = test_of_channels(name, "drive", channels, good, listed.network, asked.monomials, level, hours)
        except ReplayDataError as error:
            raise ReplayDataError(f"{name}: {error}") from None
        tests.append(with_meters(test, frame, listed.network, level))
    return replace(asked, tests=tuple(_as_the_file_runs(listed.network, tests)))


def unfitted(campaign: Campaign) -> Fit:
    """The healthy motor as its file has it: nothing was measured."""
    model = supposing(campaign.healthy)
    return fit(model, np.zeros(len(model.parameters)), NEAR_ENOUGH, linearisations=1)


def _as_the_file_runs(network: Network, tests: Sequence[Test]) -> Iterator[Test]:
    """The tests with what their sensors would show if the motor were as its file says."""
    as_file = Model(network, tests, ())
    names = [node.name for node in network.nodes]
    for number, test in enumerate(tests):
        try:
            run = as_file.course(number, np.zeros(0))[1]
        except DivergedError as error:
            raise PlanError(
                f"{test.name}: {error}. With this test: a smaller load, colder coolant or a shorter test would relax it"
            ) from None
        _refuse_too_hot(network, test, run)
        channels = tuple(replace(c, measured=run @ np.asarray(c.sensor.over(names))) for c in test.channels)
        shown = {one.channel: one.y for one in as_file.residuals_of(number, np.zeros(0))}
        meters = tuple(replace(m, measured=_reading(m, shown[m.name])) for m in test.meters)
        yield replace(test, channels=channels, meters=meters)


def _reading(meter: RecordedMeter, off: Floats) -> Floats:
    """What a meter shows by a run from which its readings are so many rows `off` (B,), step for step (N,)."""
    return meter.measured - meter.row * np.repeat(off, len(meter.measured) // len(off))


def _refuse_too_hot(network: Network, test: Test, run: Floats) -> None:
    for i, node in enumerate(network.nodes):
        if node.limit_degC is not None and (over := run[:, i] > node.limit_degC).any():
            minutes = int(over.argmax()) * STEP_S / 60
            raise PlanError(
                f"{test.name}: the {node.name} is above its {node.limit_degC:.0f} °C after {minutes:.0f} min, by the "
                "motor file: a smaller load, colder coolant, a shorter test or a higher limit_degC would relax it"
            )


def _columns(network: Network) -> dict[str, tuple[str, str]]:
    """Column -> what it sets, a feature or a boundary, and the quantity."""
    flows = {f for m in monomials(network) for f in m.features if is_flow(f)}
    inputs = {feature: "flow" if is_flow(feature) else feature for feature in (*QUANTITY, *sorted(flows))}
    around = {boundary.name: "temperature" for boundary in network.boundaries}
    return {column_name(name, of): (name, of) for name, of in (inputs | around).items()}


def _set_values(file: Path, known: Mapping[str, tuple[str, str]]) -> dict[str, Floats]:
    """Column -> a value a second, time counted from the first row."""
    rows = [row for row in csv.reader(_bytes(file).decode("utf-8-sig", "replace").splitlines()) if any(row)]
    names = [name.strip() for name in rows[0]] if rows else []
    if TIME not in names or len(set(names)) < len(names):
        wants = f"the first row names the columns, each once, and one of them is {TIME}"
        raise ReplayDataError(f"{file}: {wants}; columns are separated by commas, numbers have a decimal point.")
    for name in names:
        if name not in (*known, TIME, STEP):
            raise ReplayDataError(
                f'{file}: column "{name}" is nothing that this motor file is driven by.{hint(name, known)} '
                f"It knows: {TIME}, {', '.join(known)}."
            )
    values = _numbers(file, rows[1:], len(names))
    table = dict(zip(names, values.T, strict=True))
    times = table.pop(TIME)
    length_s = times[-1] - times[0] if len(times) else 0.0
    if not 0.0 < length_s <= LONGEST_S or (np.diff(times) <= 0).any():
        rule = f"{TIME} must rise from row to row, over two rows at least and {LONGEST_S:.0f} s at most"
        raise ReplayDataError(f"{file}: {rule}.")
    for name, (_, of) in known.items():
        if of == "temperature" and name in table and table[name].min() < COLDEST_degC:
            raise ReplayDataError(
                f"{file}: {name} falls to {table[name].min():g}, below {COLDEST_degC} °C: correct it."
            )
    seconds = np.arange(0.0, length_s + STEP_S / 2, STEP_S)
    set_values = {name: np.interp(seconds, times - times[0], column) for name, column in table.items() if name in known}
    return {TIME: seconds, **set_values}


def _numbers(file: Path, rows: Sequence[Sequence[str]], width: int) -> Floats:
    found = np.empty((len(rows), width))
    for place, row in enumerate(rows):
        try:
            found[place] = [float(cell) for cell in row]
        except ValueError:
            found[place] = np.nan
        if not np.isfinite(found[place]).all():
            raise ReplayDataError(f"{file}: row {place + 2} does not hold {width} numbers: {','.join(row)[:60]}")
    return found


def _bytes(file: Path) -> bytes:
    try:
        return file.read_bytes()
    except OSError as error:
        raise ReplayDataError(f"{file}: {error.strerror or error}: correct the path.") from error


def _channels(listed: Listed, name: str, columns: Mapping[str, Floats]) -> list[ChannelData]:
    """A test's set values, sensors and meters as the channels of a session; sensors show the mean of what is around at
    the start, from which the start is then known as a recorded one is. A power is compared with that of the shaft, and
    is not measured where a test does not say that."""
    network, known = listed.network, _columns(listed.network)
    around = [boundary.name for boundary in network.boundaries]
    said = {AMBIENT: AMBIENT_degC} | {str(channel.node): channel.value for channel in valued(listed.bench)}
    t_ns = (1e9 * columns[TIME]).astype(np.int64)
    given = {one: np.full(len(t_ns), value) for one, value in said.items() if one in around}
    given |= {known[column][0]: values for column, values in columns.items() if column in known}
    needed = {f for m in monomials(network) for f in m.features if quantity(f) is not None}
    if missing := [column for column, (one, _) in known.items() if one in needed.union(around) - given.keys()]:
        raise ReplayDataError(f"{name}: the motor file needs {missing[0]}: add that column.")
    start = float(np.mean([given[one][0] for one in around]))
    regions = {node.name: node.region for node in network.nodes}
    of = dict(known.values())
    inputs = [(_input(one, of[one], one in around), values) for one, values in given.items()]
    shaft = {"speed_rpm", "torque_Nm"} <= columns.keys()
    observed = [one for one in observing(listed.bench, around, regions) if one.quantity != "power" or shaft]
    sensors = [(one, np.full(len(t_ns), start if one.quantity == "temperature" else 1.0)) for one in observed]
    zeros = np.zeros(len(t_ns), np.int64)
    return [ChannelData(spec, t_ns, values, zeros, zeros, (name,), (_bus(spec),)) for spec, values in inputs + sensors]


def _input(name: str, of: str, is_boundary: bool) -> ResolvedChannel:
    return ResolvedChannel(
        name=name,
        quantity=of,
        unit=STORED_UNIT[of],
        node=name if is_boundary else None,
        role="input",
        conversion=Conversion(),
        signals=(),
    )


def _bus(spec: ResolvedChannel) -> str:
    bus, colon, _ = (spec.signal or "").partition(":")
    return bus if colon else BUS
