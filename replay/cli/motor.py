"""`whyhot motor check FILE`, and what else there is to do with one: new, import, scale, slice, plot, reduce, export."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ingest.texts.names import handle
from replay.cli.answer import Answer, provenance, store_folder
from replay.cli.asked import picture, sessions_of

if TYPE_CHECKING:
    from twin.motor.network import Network

# action -> (what it does, flags that it needs, flags that it may have)
ACTIONS: dict[str, tuple[str, tuple[str, ...], tuple[str, ...]]] = {
    "check": ("read it, refuse what is impossible, print what it holds", ("file",), ()),
    "new": ("a blank commented file to fill in", ("out",), ("topology",)),
    "import": (
        "what a design program exports: Motor-CAD's matrices as a motor file, a map's losses",
        ("file", "out"),
        ("flow_lpm",),
    ),
    "scale": ("the same motor in another size", ("file", "length", "out"), ()),
    "slice": ("cut along the stack, for a profile", ("file", "into", "stack_mm", "nodes", "out"), ()),
    "plot": ("a picture of the network", ("file", "out"), ("at",)),
    "reduce": ("fewer nodes, by their error on sessions", ("file", "on", "out"), ("to", "hold_out", "curve")),
    "export": ("the current file of a motor of the store", ("file", "out"), ()),
}


def arguments(parser: argparse.ArgumentParser) -> None:
    from replay.studies.motors.new import DEFAULT, TOPOLOGIES

    says = "; ".join(f"{action}: {what}" for action, (what, _, _) in ACTIONS.items())
    parser.add_argument("action", choices=tuple(ACTIONS), help=says)
    says = (
        "a motor file (all but new); of import an .rmf, .mat or table; of export the name of a motor, or a model's id"
    )
    parser.add_argument("file", metavar="FILE", nargs="?", type=Path, help=says)
    says = "the file to write: a motor file, of plot an .svg; of import of maps a folder"
    parser.add_argument("-o", "--out", metavar="OUT", type=Path, help=says)
    topologies = "; ".join(f"{name}: {what}" for name, what in TOPOLOGIES.items())
    new = parser.add_argument_group("new")
    new.add_argument("--topology", choices=tuple(TOPOLOGIES), help=f"{topologies} (default: {DEFAULT})")
    imported = parser.add_argument_group("import")
    says = "the volume flow of each circuit in the export [l/min]"
    imported.add_argument("--flow-lpm", nargs="+", type=float, metavar="V", help=says)
    scale = parser.add_argument_group("scale")
    scale.add_argument("--length", type=float, metavar="K", help="every length of the motor times K, such as 0.8")
    slices = parser.add_argument_group("slice")
    slices.add_argument("--into", type=int, metavar="N", help="slices along the stack")
    slices.add_argument("--stack-mm", type=float, metavar="L", help="length of the stack in mm")
    slices.add_argument("--nodes", nargs="+", metavar="NODE", help="the nodes that reach along the stack")
    plot = parser.add_argument_group("plot")
    says = "operating point, such as speed_rpm=6000 current_A=225 (default: half of [scale])"
    plot.add_argument("--at", nargs="+", metavar="X=V", help=says)
    reduce = parser.add_argument_group("reduce")
    enough = "the fewest that are good enough on sessions of --hold-out"
    reduce.add_argument("--to", type=int, metavar="N", help=f"nodes of the motor that is written (default: {enough})")
    reduce.add_argument("--on", nargs="+", metavar="S", help="sessions whose runs propose what to merge")
    says = "kept sessions, whose error decides what is merged (default: those of --on)"
    reduce.add_argument("--hold-out", nargs="+", metavar="S", help=says)
    reduce.add_argument("--curve", metavar="F.svg", type=picture, help="draw nodes against error to this file")
    parser.set_defaults(refuse=parser.error)


def run(args: argparse.Namespace) -> Answer:
    _check_flags(args)
    verbs = {"check": _check, "new": _new, "scale": _scale, "slice": _slice, "plot": _plot, "reduce": _reduce}
    return (verbs | {"import": _import, "export": _export})[args.action](args)


def _check_flags(args: argparse.Namespace) -> None:
    """One line where the action lacks a flag, or has one of another action."""
    _, needed, allowed = ACTIONS[args.action]
    every = dict.fromkeys(flag for _, needs, may in ACTIONS.values() for flag in (*needs, *may))
    for flag in every:
        given = getattr(args, flag) is not None
        if flag in needed and not given:
            args.refuse(f"{args.action} needs {_written(flag)}")
        if given and flag not in (*needed, *allowed):
            args.refuse(f"{args.action} takes no {_written(flag)}")


def _written(flag: str) -> str:
    return {"file": "FILE", "out": "-o OUT"}.get(flag, f"--{flag.replace('_', '-')}")


def _check(args: argparse.Namespace) -> Answer:
    from twin.run.describe import describe

    description = describe(_network(args))
    return Answer(_data("check", **description.to_json()), description.text())


def _new(args: argparse.Namespace) -> Answer:
    from replay.engine.files.motor_file import read_motor
    from replay.studies.motors.new import DEFAULT, TOPOLOGIES, template

    topology = args.topology or DEFAULT
    text = template(topology)
    network = read_motor(text, f"{topology}.toml")
    _write(args.out, text)
    says = f"{args.out}   {TOPOLOGIES[topology]}\nevery number is an order of magnitude: replace it by your motor's"
    return Answer(_data("new", file=str(args.out), topology=topology, nodes=len(network.nodes)), says)


def _import(args: argparse.Namespace) -> Answer:
    from replay.engine.files.motor_file import read_motor
    from replay.errors import MotorFileError
    from replay.studies.motors import loss_tables, motorcad_maps
    from replay.studies.motors.motorcad import is_matrices, motor_of

    maps = {".mat": motorcad_maps.maps_of} | dict.fromkeys((".csv", ".txt", ".xlsx"), loss_tables.maps_of)
    if maps_of := maps.get(args.file.suffix.lower()):
        return _import_maps(args.out, maps_of(args.file))
    if not is_matrices(args.file):
        raise MotorFileError(
            f"{args.file}: is neither an .rmf nor a .mat of Motor-CAD, nor a table of losses (.csv, .xlsx): give what "
            "it exported."
        )
    text = motor_of(args.file, args.flow_lpm or ()).encode()
    network = read_motor(text, args.out.name)
    _write(args.out, text)
    data = _data("import", file=str(args.out), nodes=len(network.nodes), links=len(network.links))
    says = f"{args.out}   {network.name}: {len(network.nodes)} nodes, {len(network.links)} links"
    return Answer(data, f"{says}\nits conductances and losses are of one operating point: give them their features")


def _import_maps(folder: Path, maps: dict[str, str]) -> Answer:
    from replay.errors import MotorFileError

    try:
        folder.mkdir()
    except OSError as error:
        raise MotorFileError(f"{folder}: {error.strerror}: give a folder that is not there yet with -o.") from None
    for name, text in maps.items():
        _write(folder / f"{name}.csv", text.encode())
    says = f'{folder}   {len(maps)} maps: {", ".join(maps)}\nname one in the motor file: map = "{folder.name}/NAME.csv"'
    return Answer(_data("import", folder=str(folder), maps=[f"{name}.csv" for name in maps]), says)


def _scale(args: argparse.Namespace) -> Answer:
    from replay.engine.files.motor_file import read_motor
    from replay.engine.files.motor_maps import whole
    from replay.studies.motors.scale import scaled_file

    text = scaled_file(whole(args.file), args.file.name, args.length)
    network = read_motor(text, args.out.name)
    _write(args.out, text)
    data = _data("scale", file=str(args.out), motor=network.name, length=args.length, scale=dict(network.scale))
    return Answer(data, f"{args.out}   {network.name}\ncheck [scale], and replace what you know of the new motor")


def _slice(args: argparse.Namespace) -> Answer:
    from replay.engine.files.motor_maps import whole
    from replay.studies.motors.scale import sliced_file

    text, network = sliced_file(whole(args.file), args.file.name, args.nodes, args.into, args.stack_mm / 1000)
    _write(args.out, text)
    data = _data("slice", file=str(args.out), motor=network.name, nodes=len(network.nodes), links=len(network.links))
    return Answer(data, f"{args.out}   {network.name}: {len(network.nodes)} nodes, {len(network.links)} links")


def _plot(args: argparse.Namespace) -> Answer:
    from replay.show.plots.network_plot import draw_network, operating_point

    if args.out.suffix != ".svg":
        args.refuse(f"plot writes an SVG: end -o {args.out} in .svg")
    network = _network(args)
    point = operating_point(network, args.at or ())
    draw_network(network, point, args.out)
    data = _data("plot", file=str(args.out), motor=network.name, nodes=len(network.nodes), at=dict(point))
    return Answer(data, f"{args.out}   {network.name}: {len(network.nodes)} nodes; opens in any browser")


def _reduce(args: argparse.Namespace) -> Answer:
    from ingest.facts import facts
    from ingest.facts.store import Store
    from replay.cli.progress import tell
    from replay.engine.results.as_json import to_json
    from replay.show.verbs.reduction import draw_curve, reduction_text
    from replay.studies.motors.reduce import ENOUGH_K, reduce_motor

    network = _network(args)
    with Store.open(store_folder(args)) as store:
        known = facts.at(store.ledger)
        on, kept = (sessions_of(known, names or ()) for names in (args.on, args.hold_out))
        found = reduce_motor(store, known, network, args.to, on, kept, tell)
        data = _data(
            "reduce",
            provenance(store, to=args.to),
            file=str(args.out),
            motor=network.name,
            nodes=len(found.chosen.groups),
            within_K=ENOUGH_K if args.to is None else None,
            on=[session.name for session in on],
            hold_out=[session.name for session in kept],
            interest=dict(found.interest),
            groups={name: list(members) for name, members in found.chosen.groups.items()},
            curve=[
                {"nodes": len(level.groups), "trained": to_json(level.trained), "kept": to_json(level.kept)}
                for level in found.curve
            ],
        )
    _write(args.out, found.text)
    if args.curve is not None:
        draw_curve(data, args.curve)
    return Answer(data, reduction_text(data))


def _export(args: argparse.Namespace) -> Answer:
    from ingest.facts import facts
    from ingest.facts.store import Store
    from replay.engine.files.models import current_model

    with Store.open(store_folder(args)) as store:
        known = facts.at(store.ledger)
        model = current_model(known, str(args.file))
        _write(args.out, store.archive.read(model))
        motor = known.models[model].motor
        data = _data("export", provenance(store), file=str(args.out), motor=motor, model=model)
    return Answer(data, f"{args.out}   {motor}, model {handle(model)}")


def _network(args: argparse.Namespace) -> Network:
    from replay.engine.files.motor_maps import read_motor_file

    return read_motor_file(args.file)


def _data(action: str, made_from: dict[str, Any] | None = None, /, **values: Any) -> dict[str, Any]:
    return {"schema": f"whyhot.motor_{action}/1", **values, "provenance": made_from or provenance(None)}


def _write(path: Path, text: bytes) -> None:
    """Never over a file that is there. Raises MotorFileError."""
    from replay.errors import MotorFileError

    try:
        with path.open("xb") as file:
            file.write(text)
    except FileExistsError:
        raise MotorFileError(f"{path}: is there already: give another name with -o, or remove it first.") from None
