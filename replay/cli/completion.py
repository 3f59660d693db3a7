"""`whyhot completion bash|zsh|fish`: the script that makes a shell complete verbs, options and names of the store."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

from replay.cli.answer import Answer, store_folder

if TYPE_CHECKING:
    from ingest.facts.events import Event

# Each script asks `whyhot completion words -- WORD...`, the words typed so far, the last one not yet whole; where
# nothing comes back, the shell completes names of files.
SCRIPTS = {
    "bash": """\
# whyhot: put  eval "$(whyhot completion bash)"  into ~/.bashrc
_whyhot() {
    local found
    COMPREPLY=()
    while IFS= read -r found; do
        [[ -n "$found" ]] && COMPREPLY+=("$(printf %q "$found")")
    done < <(whyhot completion words -- "${COMP_WORDS[@]:1:COMP_CWORD}" 2>/dev/null)
}
complete -o default -F _whyhot whyhot
""",
    "zsh": """\
# whyhot: put  eval "$(whyhot completion zsh)"  into ~/.zshrc, behind compinit
_whyhot() {
    local -a found
    found=("${(@f)$(whyhot completion words -- "${(@)words[2,CURRENT]}" 2>/dev/null)}")
    if [[ -n "$found" ]]; then compadd -- $found; else _files; fi
}
compdef _whyhot whyhot
""",
    "fish": """\
# whyhot: save as ~/.config/fish/completions/whyhot.fish
function __whyhot
    set -l typed (commandline -opc)[2..-1] (commandline -ct)
    whyhot completion words -- $typed 2>/dev/null
end
complete -c whyhot -a "(__whyhot)"
""",
}
WORDS = "words"
# What an argument names, by its own name: sessions (s), logs (l), bench files (b), diagnoses (d), motors (m).
SESSIONS = ("session", "sessions", "on", "hold_out", "first", "second")
MODELS = ("model", "motor")
NAMED = {"what": "sldmb", "diagnosis": "d", "log": "l"} | dict.fromkeys(SESSIONS, "s") | dict.fromkeys(MODELS, "m")
OF_VERB = {  # and by the verb where that matters
    ("report", "sessions"): "sd",
    ("bench", "bench"): "bs",
    ("correct", "what"): "sl",
    ("retract", "what"): "sld",
}


def arguments(parser: argparse.ArgumentParser) -> None:
    says = f"the shell; {WORDS}: what the last of WORD may become, as the scripts ask"
    parser.add_argument("shell", choices=(*SCRIPTS, WORDS), help=says)
    parser.add_argument("typed", metavar="WORD", nargs="*", help=f"of {WORDS}: what was typed behind whyhot")


def run(args: argparse.Namespace) -> Answer:
    found = candidates(args.typed) if args.shell == WORDS else []
    data = {"schema": "whyhot.completion/1", "shell": args.shell, "candidates": found}
    return Answer(data, SCRIPTS.get(args.shell, "\n".join(found)).rstrip("\n"))


def candidates(typed: Sequence[str]) -> list[str]:
    """What the last word of `typed` may become; nothing where it is no verb, option or name of the store."""
    from replay.cli import VERBS

    *before, begun = typed or [""]
    if not before:
        return _beginning(begun, [*VERBS, "--help", "--version"])
    actions = _actions(before[0])
    if begun.startswith("-"):
        return _beginning(begun, [option for one in actions for option in one.option_strings])
    asked = _asked(actions, before[1:])
    if asked is None:
        return []
    kinds = OF_VERB.get((before[0], asked.dest), NAMED.get(asked.dest, ""))
    if [*before[:2], asked.dest] == ["motor", "export", "file"]:
        kinds = "m"
    return _beginning(begun, asked.choices or _names(kinds, before))


def _beginning(begun: str, words: Iterable[str]) -> list[str]:
    return [word for word in dict.fromkeys(words) if word.startswith(begun)]


def _actions(verb: str) -> list[argparse.Action]:
    """The arguments of a verb, none where there is no such verb."""
    from replay.cli import build_parser

    (verbs,) = (one for one in build_parser(verb)._actions if isinstance(one, argparse._SubParsersAction))
    return verbs.choices[verb]._actions if verb in verbs.choices else []


def _asked(actions: Sequence[argparse.Action], given: Sequence[str]) -> argparse.Action | None:
    """The argument that the word behind `given` is of: the last option where that takes more, else by its place."""
    options = {option: one for one in actions for option in one.option_strings}
    places = [one for one in actions if not one.option_strings]
    current: argparse.Action | None = None
    for word in given:
        if word.startswith("-"):
            current = options.get(word)
            current = current if current is None or current.nargs != 0 else None
        elif current is None or current.nargs not in ("+", "*"):
            places = places[1:] if current is None and len(places) > 1 else places
            current = None
    return current or (places[0] if places else None)


def _names(kinds: str, before: Sequence[str]) -> list[str]:
    """Names of these kinds in the store that is typed, newest first; the ledger is only read."""
    from ingest.errors import IngestError
    from ingest.facts.standing import standing
    from ingest.facts.store import Store

    store = next((after for word, after in pairwise(before) if word == "--store"), None)
    if not kinds:
        return []
    try:
        with Store.open(store_folder(argparse.Namespace(store=store))) as opened:
            stands = standing(opened.ledger.events())
    except IngestError:  # no store here: nothing to name
        return []
    if "--undo" in before:
        return [one.event.name for one in reversed([*stands.retractions.values()])]
    names = (_name(one.event) for one in reversed(stands.events))
    return [name for kind, name in names if kind and kind in kinds]


def _name(event: Event) -> tuple[str, str]:
    """The kind and name of what an event brought, both empty where it brought nothing that is called."""
    from ingest.facts.events import BenchRegistered, DiagnosisCompleted, ModelPublished, RawFileSealed, SessionRecorded

    if isinstance(event, SessionRecorded):
        return "s", event.name
    if isinstance(event, RawFileSealed | BenchRegistered):
        return ("l" if isinstance(event, RawFileSealed) else "b"), event.name
    if isinstance(event, DiagnosisCompleted):
        return "d", f"d-{event.diagnosis[:8]}"
    return ("m", event.motor) if isinstance(event, ModelPublished) else ("", "")
