"""The command line: one file a verb. A verb parses, calls and words its answer; no logic lives here.

Exit codes: 0 done; 1 done with something refused or quarantined; 2 could not start or stopped before its end;
130 interrupted.
"""

from __future__ import annotations

import argparse
import gc
import logging
import os
import sys
from collections.abc import Sequence
from contextlib import suppress
from importlib import import_module
from typing import Any, NoReturn, TextIO

from ingest.texts.plain import plain_line
from replay.cli.answer import Answer, deliver, deliver_error, store_folder
from replay.cli.encoding import fit_output, say
from replay.cli.interrupt import DUCKDB, stopping
from replay.cli.refusal import of_machine, refusal
from replay.cli.status import status
from replay.show.words.width import width

VERBS: dict[str, str] = {
    "demo": "the whole way on shipped recordings of a real motor, offline",
    "morning": "what a day's logs hold, what is wrong with them, and the last run of each test beside them",
    "inspect": "what is inside log files, before anything is stored; drafts a bench file",
    "ingest": "seal, record and decode log files, and account for every record",
    "attach": "seal a photograph, thermogram or any file with what was found on a specimen",
    "sessions": "the catalogue of recorded sessions",
    "show": "one session: channels, gaps, quality, power balance, operating points",
    "repeat": "the same test again: what two sessions read differently where they were driven alike, and since when",
    "export": "the samples of a session as CSV, Excel, Parquet, MCAP or MF4",
    "motor": "motor files: check, new, scale, slice, plot, reduce, export",
    "bench": "bench files: export",
    "calibrate": "fit a motor file's coefficients to recorded sessions, as a new model",
    "protocol": "which coefficients matter, their fit to S1 and S2 points, and a check on drive cycles",
    "diagnose": "show what the model gets wrong, name the cause, extend the model, measure the gain",
    "seen": "in which other sessions of the store a diagnosed cause acts, and since when",
    "bisect": "from which session, bench or motor file on a channel is off from the model, and what changed there",
    "plan": "which causes recorded sessions can show, and the bench day that would show most of the others",
    "accept": "make the motor and bench files of a diagnosis the current ones",
    "review": "what accepting a diagnosis changes, as a page that a colleague can sign",
    "replay": "rerun the twin over sessions and say what it gets wrong",
    "sensors": "how far off the model is without each sensor, and how far below its limit a vehicle keeps a hot spot",
    "envelope": "largest torque over speed within the temperature limits: continuous, and for 10, 30 and 60 s",
    "ageing": "insulation across cycles and across the fleet: doses, resistances, courses, who stands out",
    "report": "one HTML file of replays or of a diagnosis, readable offline",
    "index": "pages over the whole store for a share: sessions, diagnoses, stators; only what changed is written again",
    "view": "measured and modelled temperatures in the rerun viewer",
    "notebook": "a campaign, a stator, a fleet or models in a notebook, in marimo or for Jupyter",
    "sql": "ask the store's tables in SQL, read-only",
    "lineage": "from a number back to the frames, files, code and command that it came from",
    "retract": "take back a log, session, diagnosis or inspection, with a reason; no bytes are deleted",
    "forget": "remove the bytes of a log for good, with a reason; the fact and its hash remain",
    "correct": "correct what a log is of, or which files it is read with, with a reason",
    "stale": "answers whose inputs have changed since, and why; asks them again with --redo",
    "upgrade": "decode again the logs that an earlier version decoded; facts stay as they are",
    "rebuild": "make samples and SQL tables again from the sealed logs",
    "verify": "check every fact, and with --read every sealed byte",
    "head": "a short proof of all facts so far, to keep elsewhere: position and Merkle root",
    "backup": "a second copy of the store in another folder: only what is new is copied; others may write meanwhile",
    "restore": "a new store from a backup, checked to the last byte",
    "move": "the ledger into a PostgreSQL server, or the files into a bucket; or back into the store's folder",
    "completion": "the script that makes bash, zsh or fish complete verbs, options and names of the store",
    "doctor": "versions, SQLite safety, store and disk: what a problem report needs",
}

# When Python looks for garbage in cycles. Seldom among all that is imported: that takes a twelfth of a verb's time.
# Often among what is new: a few objects in a cycle may hold the records of a whole batch.
SELDOM = (2_000, 100, 1_000)


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point of the `whyhot` command; returns the exit code."""
    gc.set_threshold(*SELDOM)
    logging.getLogger("matplotlib").setLevel(logging.ERROR)  # it says at length where it cannot keep its list of fonts
    fit_output()
    try:
        with stopping():
            code = _answer(_json_words(list(sys.argv[1:] if argv is None else argv)))
        sys.stdout.flush()
        return code
    except BrokenPipeError:  # `whyhot ... | head`: nobody reads on
        _drop(sys.stdout)
        return 0
    except OSError as error:  # of what was to be said, not of what was asked for
        _drop(sys.stdout)
        try:
            say(of_machine(error, "the answer cannot be written"), sys.stderr)
            sys.stderr.flush()
        except OSError:
            _drop(sys.stderr)
        return 2
    except KeyboardInterrupt:
        say("interrupted: what was finished is kept; the same command goes on from there.", sys.stderr)
        return 130


def _answer(words: list[str]) -> int:
    """What the words ask for, delivered. Raises OSError where it cannot be written."""
    verb = next((word for word in words if not word.startswith("-")), None)
    if verb is not None and words[0] == verb and verb not in VERBS:
        from ingest.texts.nearest import hint

        say(plain_line(f"whyhot: {verb} is no verb.{hint(verb, VERBS)} whyhot --help lists all"), sys.stderr)
        return 2
    if words and (option := words[0].partition("=")[0]) in ("--store", "--json"):
        say(f"whyhot: {option} stands behind a verb: whyhot VERB {option}. See whyhot --help", sys.stderr)
        return 2
    try:
        parser = build_parser(verb)
    except ImportError as error:  # another module hides one of ours, or a part is not installed
        say(f"whyhot: {error}", sys.stderr)
        return 2
    # Till the words are understood:
    args = argparse.Namespace(verb=verb, store=None, json=_json_of(words) if verb else None)
    try:
        if (word := next((one for one in words if one[:2] == "--" and one.endswith("=--")), None)) is not None:
            parser.error(f"argument {word[:-3]}: expected one argument")  # argparse would give an empty list
        args = parser.parse_args(words)
        if args.verb is None:
            answer = Answer({}, status(store_folder(args)) or parser.format_help())
        else:
            answer = import_module(f"replay.cli.{args.verb}").run(args)
    except _WrongWords as wrong:
        deliver_error(args, wrong.line)
        raise
    except BrokenPipeError:
        raise
    except Exception as error:
        if str(error) == DUCKDB:
            raise KeyboardInterrupt from None
        line = refusal(error, args)
        if line is None:
            raise
        return deliver_error(args, line)
    return deliver(args, answer)


def _drop(stream: TextIO) -> None:
    """Let what could not be written go nowhere, so that it is not tried again at the end of the process."""
    with suppress(OSError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


class _Help(argparse.HelpFormatter):
    """As wide as all else that is printed."""

    def __init__(self, prog: str) -> None:
        super().__init__(prog, width=width())


class _WrongWords(SystemExit):
    """The words are none of a verb's: `line` says which, and the process ends with 2."""

    def __init__(self, line: str) -> None:
        super().__init__(2)
        self.line = line


class _Parser(argparse.ArgumentParser):
    """Refuses wrong words in one line, as every other refusal, and a verb its own."""

    def __init__(self, **given: Any) -> None:
        super().__init__(formatter_class=_Help, **given)

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> tuple[Any, list[str]]:
        return self._understood(*super().parse_known_args(args, namespace))

    def _understood(self, found: Any, unknown: list[str]) -> tuple[Any, list[str]]:
        if unknown:
            from ingest.texts.nearest import hint

            near = hint(unknown[0].partition("=")[0], self._option_string_actions)
            self.error(f"{' '.join(unknown)} is not understood.{near}")
        return found, unknown

    def error(self, message: str) -> NoReturn:
        raise _WrongWords(plain_line(f"{self.prog}: {message.removesuffix('.')}. See {self.prog} --help"))


class _VerbParser(_Parser):
    """Of one verb: its options may stand between its names, as in `motor check --json motor.toml`."""

    _mixing = False

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> tuple[Any, list[str]]:
        if self._mixing:  # argparse comes back twice: for the options, then for the names that are left
            return argparse.ArgumentParser.parse_known_args(self, args, namespace)
        self._mixing = True
        if "--" in args:  # behind it are names only, which the second time would be options
            return super().parse_known_args(args, namespace)
        return self._understood(*self.parse_known_intermixed_args(args, namespace))


def build_parser(verb: str | None) -> argparse.ArgumentParser:
    """Only the verb that is asked for is imported, so that `--help` answers at once."""
    from whyhot import __version__

    parser = _Parser(
        prog="whyhot",
        description="Why is the motor hotter than the model says?",
        epilog="`whyhot VERB --help` says more. Begin with: whyhot demo",
    )
    parser.add_argument("--version", action="version", version=f"whyhot {__version__}")
    parser.set_defaults(json=None, store=None)
    verbs = parser.add_subparsers(dest="verb", metavar="VERB", title="verbs", parser_class=_VerbParser)
    for name, says in VERBS.items():
        sub = verbs.add_parser(name, help=says, description=says[0].upper() + says[1:] + ".")
        if name == verb:
            import_module(f"replay.cli.{name}").arguments(sub)
            sub.add_argument("--store", metavar="DIR", help="the store (default: WHYHOT_STORE, else ./whyhot-store)")
            to = "answer as JSON, to FILE.json or standard output"
            sub.add_argument("--json", metavar="FILE.json", nargs="?", const="-", help=to)
    return parser


def _json_words(words: list[str]) -> list[str]:
    """The words with `--json out.json` as `--json=out.json`; where the next word is no name in .json, as `--json=-`."""
    joined: list[str] = []
    left = words[::-1]
    while left:
        word = left.pop()
        if word == "--json":
            word = f"--json={left.pop() if left and left[-1].endswith('.json') else '-'}"
        joined.append(word)
    return joined


def _json_of(words: Sequence[str]) -> str | None:
    """Where `_json_words` send the JSON; None where no word says."""
    said = (word.removeprefix("--json=") for word in words if word.startswith("--json="))
    return next((target for target in said if target != "--"), None)
