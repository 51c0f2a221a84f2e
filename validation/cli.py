"""The `robotball` command: arguments in, exit status out.

Exit status: 0 agreement within the stated bound, 1 not, 2 bad input, or what the system refuses.
The module of a command is imported when that command is named.
"""

import ast
import atexit
import contextlib
import gc
import io
import logging
import re
import sys
import warnings
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import is_dataclass
from importlib import import_module
from pathlib import Path
from shutil import get_terminal_size
from textwrap import fill
from types import ModuleType
from typing import Annotated, Any, Protocol, Union, get_type_hints

import tyro
from tyro.conf import subcommand

from robotball.errors import InputError, SceneWarning, UnitWarning, unknown

from .options import BAD_INPUT, Controls, File, Names


@contextlib.contextmanager
def _standard_output_of(command: object) -> Iterator[None]:
    """Keep standard output for one result, where an option of a command is `-`.

    Tables and messages go to standard error then. Raises InputError for more than one such option,
    and, before any work, for a file that cannot be written.
    """
    from robotball.files.replacing import STANDARD_OUTPUT  # which --help does without

    from .output import writable_file

    count = [*map(writable_file, _files(command))].count(STANDARD_OUTPUT)
    if count > 1:
        raise InputError("standard output takes one result: give `-` to one option alone")
    # Else the tables would stand in the middle of the JSON that is piped on.
    with contextlib.redirect_stdout(sys.stderr) if count else contextlib.nullcontext():
        yield


def _files(options: Any) -> Iterator[Path]:
    """Yield the files that a command is to write by its options, in groups of them too."""
    kinds = get_type_hints(type(options), include_extras=True)
    for name, value in vars(options).items():
        if is_dataclass(value):
            yield from _files(value)
        elif value is not None and kinds[name] == File:
            yield value


class _Command(Protocol):
    """The options of a command, and what it does with them."""

    def run(self) -> int:
        """Do the work, and return the exit status."""


_INTERRUPTED = 130
_AS_GIVEN = "--as-given"  # of every command: numbers that seem to be in another unit are meant
# What one wants and its commands, each with the module of its class, loaded when the command runs.
GROUPS = {
    "Roll and compare": {
        "demo": ".commands.compare",
        "scenes": ".commands.scene_commands",
        "compare": ".commands.compare",
        "report": ".commands.report",
        "video": ".commands.film",
        "view": ".commands.film",
    },
    "My own robot": {
        "check": ".commands.checking",
        "design": ".commands.building",
        "steer": ".commands.building",
        "fit": ".commands.fitting",
    },
    "Which settings, and their cost": {
        "ablation": ".studies.ablation",
        "convergence": ".studies.convergence",
        "tradeoff": ".studies.tradeoff",
        "extremes": ".studies.extremes",
    },
    "Other engines and programs": {
        "engines": ".studies.engine_study",
        "export": ".commands.scene_commands",
        "judge": ".studies.judge",
    },
    "What the ball does": {
        "section": ".studies.contact_sections",
        "lyapunov": ".studies.contact_tangent",
        "basins": ".studies.basins",
        "equilibria": ".commands.equilibria_list",
        "continue": ".studies.branches",
        "chart": ".studies.charts",
    },
}
COMMANDS = {name: module for group in GROUPS.values() for name, module in group.items()}
_WHAT = """usage: robotball COMMAND [OPTIONS]

Run a rolling ball by a physics engine and by the equations, and compare the two.

Example: robotball compare fig12
"""
_MORE = """
`robotball help COMMAND` has the options of a command and an example.
`robotball --version` names the versions.
`robotball --tyro-print-completion bash` (or zsh) prints what completes commands and options.
With --as-given any command takes a number that seems to be in another unit as it is written."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and exit with its status."""
    # A command loads a million objects, of which few are garbage: Python looks for them seldom, and
    # not once more at the end, which together takes half a second.
    gc.set_threshold(50_000)
    atexit.register(gc.freeze)
    # A run's monitor reports what the engine would only log.
    logging.getLogger("absl").setLevel(logging.ERROR)
    # Once, as many runs of one scene would tell the same.
    warnings.simplefilter("once", SceneWarning)
    warnings.filterwarnings("ignore", module="matplotlib")  # a picture is right, or a test fails
    warnings.showwarning = _show_warning
    arguments = list(sys.argv[1:] if arguments is None else arguments)
    if _AS_GIVEN in arguments:
        arguments.remove(_AS_GIVEN)
    else:
        warnings.simplefilter("error", UnitWarning)
    try:
        if arguments == ["--version"]:
            print(_version_line())
            sys.exit(0)
        command = parse(arguments)
        from robotball.processes import at_most  # which --help does without

        with _standard_output_of(command), at_most(getattr(command, "threads", None)):
            status = command.run()
        sys.stdout.flush()
    except KeyboardInterrupt:
        status = _INTERRUPTED
    except Exception as error:
        if (refusal := _refusal(error)) is None:
            raise
        print(f"robotball: {refusal}", file=sys.stderr)
        status = BAD_INPUT
    sys.exit(status)


def _refusal(error: Exception) -> str | None:
    """Return one line on what the input or the system refuses; None for an error of our own."""
    match error:
        case UnitWarning():
            return f"{error} ({_AS_GIVEN} takes it as it is written)"
        case InputError():
            return str(error)
        case OSError():
            what = f"{error.filename}: " if error.filename else ""
            return f"{what}{error.strerror or error}"
        case MemoryError():
            return "there is not enough memory for this; ask for less"
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


def parse(arguments: Sequence[str]) -> _Command:
    """Return the command of the arguments. Raises InputError, in one line, if they make none."""
    if arguments[:1] == ["help"]:
        arguments = [*arguments[1:2], "--help"]
    name = arguments[0] if arguments else ""
    if name in ("-h", "--help"):
        print(_overview())
        sys.exit(0)
    if name.startswith("--tyro"):  # the completion of a shell, of all commands with their options
        every: Any = Union[tuple(Annotated[class_of(one), subcommand(one)] for one in COMMANDS)]  # noqa: UP007
        return tyro.cli(every, args=arguments, prog="robotball")
    if not name:
        raise InputError("which command? 'robotball --help' lists them")
    if name not in COMMANDS:
        raise unknown("command", name, [*COMMANDS, "help", "--version"])
    helped = not {"-h", "--help"}.isdisjoint(arguments)
    command, refusal = _options_of(name) if helped else class_of(name), io.StringIO()
    _check_each_is_given_once(command, arguments)
    try:
        # tyro draws a box of many lines, and a refusal is one line here.
        with contextlib.redirect_stderr(refusal):
            return tyro.cli(command, args=arguments[1:], prog=f"robotball {name}")
    except SystemExit as leaving:
        if not leaving.code:
            raise
        _check_each_is_known(name, arguments)
        raise InputError(_words_of(name, refusal.getvalue())) from None


def _check_each_is_given_once(command: type[_Command], arguments: Sequence[str]) -> None:
    """Raises InputError for an option that stands twice: all but the last would be lost."""
    fields = get_type_hints(command, include_extras=True)
    lists = {f"--{name}" for name, kind in fields.items() if kind in (Names, Controls)}
    for option, times in Counter(_options_in(arguments)).items():
        if times > 1 and option not in lists:
            raise InputError(f"{option} is given {times} times: give it once")


def _check_each_is_known(name: str, arguments: Sequence[str]) -> None:
    """Raises InputError for an option that the command's help does not have."""
    helped = io.StringIO()
    with contextlib.redirect_stdout(helped), contextlib.suppress(SystemExit):
        tyro.cli(class_of(name), args=["--help"])
    lines = re.findall(r"^[│ ] (?:-h, )?(--.*)", helped.getvalue(), re.MULTILINE)
    known = [each for line in lines for each in re.findall(r"(?:^|, )(--\w[\w-]*)", line)]
    for option in _options_in(arguments):
        if option not in known:
            raise unknown(f"option of {name}", option, [*known, _AS_GIVEN])


def _options_in(arguments: Sequence[str]) -> list[str]:
    """Return the options among arguments, without their values and spelled with hyphens."""
    return [each.partition("=")[0].replace("_", "-") for each in arguments if each[:2] == "--"]


def class_of(name: str) -> type[_Command]:
    """Import and return the class of a command."""
    command: type[_Command] = getattr(import_module(COMMANDS[name], __package__), name.capitalize())
    return command


def _options_of(name: str) -> type[_Command]:
    """Return the class of a command for its `--help`, without its methods.

    Of its module it takes the statements on which the options depend, and so imports nothing that
    the command works with.
    """
    file, title = _file_of(name), name.capitalize()
    wanted, kept = {title, "annotations"}, []  # the latter from __future__
    for each in reversed(ast.parse(file.read_text(encoding="utf-8")).body):
        if isinstance(each, ast.ClassDef):
            each.body = [part for part in each.body if not isinstance(part, ast.FunctionDef)]
        match each:
            case ast.ClassDef(name=word) | ast.Assign(targets=[ast.Name(id=word)]):
                made = {word}
            case _:
                made = {alias.asname or alias.name for alias in getattr(each, "names", [])}
        if made & wanted:
            kept.append(each)
            names = (node for node in ast.walk(each) if isinstance(node, ast.Name))
            wanted |= {node.id for node in names if isinstance(node.ctx, ast.Load)}
    module = ModuleType(f"{__package__}{COMMANDS[name]}.options")
    module.__package__ = f"{__package__}{COMMANDS[name]}".rpartition(".")[0]
    module.__file__ = str(file)  # where tyro reads what stands below an option
    sys.modules[module.__name__] = module
    exec(compile(ast.Module(kept[::-1], []), module.__file__, "exec"), vars(module))
    command: type[_Command] = getattr(module, title)
    return command


def _overview() -> str:
    """Return the commands in groups of what one wants, each with its first line.

    No module of a command is imported, so that `--help` is quick.
    """
    lines, width = [_WHAT], min(get_terminal_size().columns, 100)
    for wanted, commands in GROUPS.items():
        lines.append(f"{wanted}:")
        for name in commands:
            lines.append(fill(f"  {name:12}{_summary(name)}", width, subsequent_indent=" " * 14))
        lines.append("")
    return "\n".join([*lines, _MORE.strip()])


def _summary(name: str) -> str:
    """Return the first line of a command's docstring, read from its source."""
    source = _file_of(name).read_text(encoding="utf-8")
    (words,) = re.findall(rf'class {name.capitalize()}\b.*:\n    """(.*)', source)
    return str(words)


def _file_of(name: str) -> Path:
    place = COMMANDS[name].removeprefix(".").replace(".", "/")
    return Path(__file__).parent / f"{place}.py"


def _words_of(name: str, refusal: str) -> str:
    """Return the words in tyro's box, in ours where they are a program's.

    They stand below its title, above the first rule after it. Of what a command lacks it has the
    whole help, of which the names are enough.
    """
    if "Missing from" in refusal:
        missing = re.findall(r"^. {5}(\S+)", refusal.partition("For full")[0], re.MULTILINE)
        them = "it is" if len(missing) == 1 else "they are"
        return f"{name} needs {', '.join(missing)}; `robotball help {name}` says what {them}"
    parts = re.split(r"[─-]{4,}", re.sub(r"[│╰╯]", " ", refusal.partition("\n")[2]))
    words = next(" ".join(part.split()) for part in parts if part.strip())
    for theirs, ours in _IN_OUR_WORDS.items():
        words = re.sub(theirs, ours, words)
    return words


_IN_OUR_WORDS = {
    r"Error parsing (\S+): .*to float: (.*)": r"\1 takes a number, not \2",
    r"Error parsing (\S+): .*for int\(\) with base 10: (.*)": r"\1 takes a whole number, not \2",
    r"Missing value for argument '(\S+)'.*": r"\1 needs a value",
    r"invalid choice (.*) for .*'(\S+)'. Expected .*\((.*)\)\.": r"\2 is one of \3, not \1",
    r"Unrecognized options: ([^-].*)": r"there is no place for \1: names stand together, and "
    "values of one option have commas between them",
}
