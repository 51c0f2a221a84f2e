"""The `robotball` command: arguments in, exit status out.

Exit status: 0 for agreement within the bound, 1 for no agreement, 2 for bad input or if the system
refuses. The module of a command is imported when that command is named.
"""

import atexit
import contextlib
import gc
import logging
import sys
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import is_dataclass
from inspect import BoundArguments
from typing import Any, Literal

from cyclopts import App, Group, Parameter
from cyclopts.exceptions import (
    CoercionError,
    CycloptsError,
    MissingArgumentError,
    RepeatArgumentError,
    UnknownCommandError,
    UnknownOptionError,
    UnusedCliTokensError,
)

from robotball.errors import InputError, SceneWarning, UnitWarning, unknown

from .options import BAD_INPUT

_INTERRUPTED = 130
_AS_GIVEN = "--as-given"  # option of every command: accept numbers that seem to be in another unit
# The headings of `--help`, and their commands, each after its module in `commands`.
GROUPS = {
    "Compare": "compare:compare compare:report film:video film:view compare:demo robots:scenes",
    "Your own robot": "robots:check robots:fit robots:design robots:steer",
    "Engines and their settings": "study studies:engines robots:export robots:judge",
    "How the ball moves": "dynamics",
}
# Commands of two words: the help of the first word, and the second words.
FAMILIES = {
    "study": (
        "Study an engine's settings: the effect of each, the cost of accuracy, the limits.",
        "studies:ablation studies:cones studies:convergence studies:cost studies:extremes",
    ),
    "dynamics": (
        "Study the long-run motion: sections, exponents, attractors and bifurcations.",
        "dynamics:section dynamics:exponents dynamics:basins dynamics:equilibria dynamics:branches "
        "dynamics:chart",
    ),
}
_ABOUT = """Simulate a rolling robot ball with a physics engine and with exact equations.

Example: robotball compare fig12"""
_MORE = f"""With {_AS_GIVEN} every command accepts numbers that seem to be in another unit.
"robotball help COMMAND" is the same as "robotball COMMAND --help"."""
_KINDS = {float: "a number", int: "a whole number"}


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and exit with its status."""
    # A command creates a million objects, and few are garbage. Rare garbage collections, and none
    # at the end, save half a second.
    gc.set_threshold(50_000)
    atexit.register(gc.freeze)
    # The monitor of a run reports the warnings that MuJoCo would log.
    logging.getLogger("absl").setLevel(logging.ERROR)
    # Many runs of one scene would repeat a warning.
    warnings.simplefilter("once", SceneWarning)
    warnings.filterwarnings("ignore", module="matplotlib")  # tests check the pictures
    warnings.showwarning = _show_warning
    arguments = list(sys.argv[1:] if arguments is None else arguments)
    if _AS_GIVEN in arguments:
        arguments.remove(_AS_GIVEN)
    else:
        warnings.simplefilter("error", UnitWarning)
    try:
        command, bound = parse(arguments)
        from robotball.processes import at_most  # not needed by --help

        options = dict(_options_of(bound))
        with _standard_output_of(options), at_most(options.get("threads")):
            status = command(*bound.args, **bound.kwargs)
        sys.stdout.flush()
    except KeyboardInterrupt:
        status = _INTERRUPTED
    except Exception as error:
        if (refusal := _refusal(error)) is None:
            raise
        print(f"robotball: {refusal}", file=sys.stderr)
        status = BAD_INPUT
    sys.exit(status)


def parse(arguments: Sequence[str]) -> tuple[Any, BoundArguments]:
    """Return the function of a command and its arguments; print help if requested.

    Raises InputError, in one line, for arguments that no command takes, and SystemExit after help.
    """
    words = [*arguments[1:], "--help"] if arguments[:1] == ["help"] else [*arguments]
    app = application()
    try:
        command, bound, _ = app.parse_args(words, print_error=False, exit_on_error=False)
    except CycloptsError as error:
        raise InputError(_words_of(error)) from None
    if command != app.help_print:
        return command, bound
    # Without a command, cyclopts shows the help as if it had been requested.
    if {"--help", "-h"}.isdisjoint(words):
        name = " ".join(["robotball", *words])
        raise InputError(f"name a command; '{name} --help' lists the commands")
    # The help needs the docstrings of the commands, so import their modules.
    app.parse_commands(bound.arguments["tokens"])[1][-1].resolved_commands()
    command(*bound.args, **bound.kwargs)
    sys.exit(0)


def application() -> App:
    """Return all commands. The module of a command is imported when it is requested."""
    app = App(
        name="robotball",
        help=_ABOUT,
        help_epilogue=_MORE,
        help_format="markdown",
        version=_version_line,
        version_format="plaintext",
        default_parameter=Parameter(negative=(), show_default=_shown),
    )
    app.command(_completion, name="--completion")
    for heading, paths in GROUPS.items():
        _register(app, paths, Group.create_ordered(heading))
    return app


def _register(app: App, paths: str, group: Group | None = None) -> None:
    for place, path in enumerate(paths.split()):
        name = path.partition(":")[2]
        if name:
            path = f"{__package__}.commands.{path}"
            app.command(path, name=name, group=group, sort_key=place)
        else:
            words, members = FAMILIES[path]
            family = App(name=path, help=words, group=group, sort_key=place)
            _register(family, members)
            app.command(family)


def _completion(shell: Literal["bash", "zsh"], /) -> None:
    """Print a script with which a shell completes commands and options."""
    print(application().generate_completion(shell=shell))


def _shown(default: object) -> str | None:
    """Return a default as the help shows it, or None if it need not be shown."""
    return None if default in (None, (), "") or default is False else str(default)


def _words_of(error: CycloptsError) -> str:
    """Return one line with the error in the arguments and the remedy."""
    command = " ".join(error.command_chain or ())
    more = f"'robotball {command} --help'"
    match error:
        case CoercionError(token=token, target_type=kind) if token and kind in _KINDS:
            return f"{token.keyword} takes {_KINDS[kind]}, not {token.value!r}"
        case MissingArgumentError(argument=argument, keyword=None) if argument:
            return f"{command} needs {argument.name}; {more} explains {argument.name}"
        case MissingArgumentError(keyword=option):
            return f"{option} needs a value; {more} lists the values"
        case RepeatArgumentError(token=token):
            return f"{token.keyword} is given more than once; give this option once"
        case UnusedCliTokensError(unused_tokens=[first, *_]):
            return f"{command} does not take {first!r}; {more} lists the options"
        case UnknownCommandError(unused_tokens=[name, *_], app=app) if app:
            for family, (_, members) in FAMILIES.items():
                if any(member.endswith(f":{name}") for member in members.split()):
                    return f"no command is called {name!r}; it is 'robotball {family} {name}'"
            words = [word for word in app if word.isalpha()]
            return str(unknown("command", name, [*words, "help", "--version"]))
        case UnknownOptionError() if "Did you mean" not in str(error):
            return f"{error} {more} lists the options."
    return str(error)


def _options_of(bound: BoundArguments) -> Iterator[tuple[str, Any]]:
    """Yield the names and values of a command's options, also of those in groups."""
    for name, value in bound.arguments.items():
        yield from vars(value).items() if is_dataclass(value) else [(name, value)]


@contextlib.contextmanager
def _standard_output_of(options: Mapping[str, Any]) -> Iterator[None]:
    """Keep standard output for one result if an option of a command is `-`.

    Tables and messages then go to standard error. Raises InputError for more than one such option,
    and, before any work, for a file that cannot be written.
    """
    from robotball.files.replacing import STANDARD_OUTPUT

    from .output import writable_file

    files = (options[name] for name in ("json", "csv") if options.get(name) is not None)
    count = [*map(writable_file, files)].count(STANDARD_OUTPUT)
    if count > 1:
        raise InputError("standard output takes only one result: give `-` to only one option")
    # Otherwise the tables would be in the middle of the JSON in a pipe.
    with contextlib.redirect_stdout(sys.stderr) if count else contextlib.nullcontext():
        yield


def _refusal(error: Exception) -> str | None:
    """Return a line for bad input or a refusal of the system; None for an error of our own."""
    match error:
        case UnitWarning():
            return f"{error} ({_AS_GIVEN} keeps the number as it is written)"
        case InputError():
            return str(error)
        case OSError():
            what = f"{error.filename}: " if error.filename else ""
            return f"{what}{error.strerror or error}"
        case MemoryError():
            return "there is not enough memory for this command; ask for fewer or shorter runs"
        case AttributeError() | RuntimeError() | ImportError():
            from robotball.view.gl import advice, ended_import

            return advice() if ended_import(error) else None
    return None


def _show_warning(message: Warning | str, *_: object, **__: object) -> None:
    print(f"robotball: warning: {message}", file=sys.stderr)


def _version_line() -> str:
    """Return the versions that a report of an error should name."""
    from robotball.motion import versions

    own, *others = (f"{name} {number}" for name, number in versions().items() if name != "machine")
    return f"{others[0]} ({', '.join([own, *others[1:]])})"
