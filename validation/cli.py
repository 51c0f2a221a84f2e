"""The `robotball` command: arguments in, exit status out.

Exit status: 0 agreement within the stated bound, 1 not, 2 bad input, or what the system refuses.
The module of a command is imported when that command is named. A character that a stream cannot
show, and a reader that goes away, end no command.
"""

import contextlib
import io
import logging
import os
import re
import sys
import warnings
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import fields, is_dataclass, make_dataclass
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any, Protocol, Union, get_type_hints

import tyro
from tyro.conf import subcommand

from robotball.cores import at_most
from robotball.errors import InputError, SceneWarning, unknown
from robotball.files.replacing import STANDARD_OUTPUT
from validation.options import BAD_INPUT, Names


class Lasting(io.TextIOWrapper):
    """A stream that goes on, to nowhere, when its reader has left.

    Raises InputError where it cannot be written for another reason, as on a full disk.
    """

    def write(self, text: str) -> int:
        with self._going_on():
            super().write(text)
        return len(text)

    def flush(self) -> None:
        with self._going_on():
            super().flush()

    @contextlib.contextmanager
    def _going_on(self) -> Iterator[None]:
        try:
            yield
        except BrokenPipeError:
            self._drop()
        except OSError as error:
            self._drop()
            raise InputError(f"the output cannot be written: {error.strerror}") from None

    def _drop(self) -> None:
        """Send what it still holds, and all that is to come, to nowhere."""
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, self.fileno())
        os.close(nowhere)


def make_lasting() -> None:
    """Let standard output and error outlast their readers, and show `?` for what they lack.

    Streams that a caller has put in their place are left as they are.
    """
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if type(stream) is io.TextIOWrapper:
            stream.flush()
            lasting = Lasting(
                stream.buffer,
                encoding=stream.encoding,
                errors="replace",
                line_buffering=stream.line_buffering,
            )
            setattr(sys, name, lasting)


@contextlib.contextmanager
def standard_output_of(command: object) -> Iterator[None]:
    """Where an option of a command is `-`, standard output holds that result alone.

    Tables and messages go to standard error then. Raises InputError for more than one such option.
    """
    count = sum(path == STANDARD_OUTPUT for path in _paths(command))
    if count > 1:
        raise InputError("standard output takes one result: give `-` to one option alone")
    with contextlib.redirect_stdout(sys.stderr) if count else contextlib.nullcontext():
        yield


def _paths(options: Any) -> Iterator[Path]:
    """The paths among the options of a command, in groups of them too."""
    for field in fields(options):
        value = getattr(options, field.name)
        if isinstance(value, Path):
            yield value
        elif is_dataclass(value):
            yield from _paths(value)


class Command(Protocol):
    """The options of a command, and what it does with them."""

    def run(self) -> int:
        """Do the work, and return the exit status."""


INTERRUPTED = 130
FORMER_NAMES = {"ladder": "ablation"}
# The module with the class of each command, loaded when the command runs.
COMMANDS = {
    "scenes": "validation.commands.scene_commands",
    "engines": "validation.studies.engine_study",
    "compare": "validation.commands.compare",
    "report": "validation.commands.report",
    "judge": "validation.studies.judge",
    "video": "validation.commands.video",
    "view": "validation.commands.view",
    "replay": "validation.commands.compare",
    "model": "validation.commands.scene_commands",
    "export": "validation.commands.scene_commands",
    "design": "validation.commands.building",
    "steer": "validation.commands.building",
    "demo": "validation.commands.compare",
    "figures": "validation.commands.paper_commands",
    "section": "validation.studies.contact_sections",
    "lyapunov": "validation.studies.lyapunov",
    "attractors": "validation.studies.attractors",
    "basins": "validation.studies.attractors",
    "equilibria": "validation.commands.equilibria_list",
    "portraits": "validation.studies.portrait_maps",
    "paper": "validation.commands.paper_commands",
    "ablation": "validation.studies.ablation",
    "convergence": "validation.studies.convergence",
    "tradeoff": "validation.studies.tradeoff",
    "extremes": "validation.studies.extremes",
}
WHAT = """Run a rolling ball by a physics engine and by the equations, and compare the two.

Example: robotball compare fig12

`robotball COMMAND --help` has an example of each command. `robotball --version` names the versions.
`robotball --tyro-print-completion bash` (or zsh) prints what completes commands and options."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and exit with its status."""
    # A run's monitor reports what the engine would only log.
    logging.getLogger("absl").setLevel(logging.ERROR)
    warnings.simplefilter("once", SceneWarning)
    warnings.filterwarnings("ignore", module="matplotlib")  # a picture is right, or a test fails
    warnings.showwarning = _show_warning
    make_lasting()
    arguments = _renamed(sys.argv[1:] if arguments is None else arguments)
    try:
        if arguments == ["--version"]:
            print(version_line())
            sys.exit(0)
        command = parse(arguments)
        with standard_output_of(command), at_most(getattr(command, "threads", None)):
            status = command.run()
        sys.stdout.flush()
    except InputError as error:
        print(f"robotball: {error}", file=sys.stderr)
        status = BAD_INPUT
    except OSError as error:
        what = f"{error.filename}: " if error.filename else ""
        print(f"robotball: {what}{error.strerror or error}", file=sys.stderr)
        status = BAD_INPUT
    except MemoryError:
        print("robotball: there is not enough memory for this; ask for less", file=sys.stderr)
        status = BAD_INPUT
    except (AttributeError, RuntimeError) as error:
        from robotball.film.gl import advice, ended_import

        if not ended_import(error):
            raise
        print(f"robotball: {advice()}", file=sys.stderr)
        status = BAD_INPUT
    except KeyboardInterrupt:
        status = INTERRUPTED
    sys.exit(status)


def _renamed(arguments: Sequence[str]) -> list[str]:
    """The arguments with a command's former name replaced, which a line on standard error says."""
    if not arguments or arguments[0] not in FORMER_NAMES:
        return list(arguments)
    name = FORMER_NAMES[arguments[0]]
    print(f"robotball: `{arguments[0]}` is called `{name}` now", file=sys.stderr)
    return [name, *arguments[1:]]


def _show_warning(message: Warning | str, *_: object, **__: object) -> None:
    print(f"robotball: warning: {message}", file=sys.stderr)


def version_line() -> str:
    """What a report of an error should name."""
    from validation.output import versions

    own, *others = (f"{name} {number}" for name, number in versions().items() if name != "machine")
    return f"{others[0]} ({', '.join([own, *others[1:]])})"


def parse(arguments: Sequence[str]) -> Command:
    """The command of the arguments; raises InputError, in one line, where they make none."""
    name, command = "", None
    if arguments and not arguments[0].startswith("-"):
        name = arguments[0]
        if name not in COMMANDS:
            raise unknown("command", name, COMMANDS)
        command = _class_of(name)
    if command:
        _check_each_is_given_once(command, arguments)
    refusal = io.StringIO()
    try:
        with contextlib.redirect_stderr(refusal):
            if command:
                return tyro.cli(command, args=arguments[1:], prog=f"robotball {name}")
            whole = any(each.startswith("--tyro") for each in arguments)
            return tyro.cli(_any_command(whole), args=arguments, prog="robotball", description=WHAT)
    except SystemExit as leaving:
        if not leaving.code:
            raise
        raise InputError(_words_of(refusal.getvalue())) from None


def _check_each_is_given_once(command: type[Command], arguments: Sequence[str]) -> None:
    """Raises InputError for an option that stands twice: all but the last would be lost."""
    fields = get_type_hints(command, include_extras=True)
    lists = {f"--{name}" for name, kind in fields.items() if kind == Names}
    options = [each.partition("=")[0] for each in arguments if each.startswith("--")]
    for option, times in Counter(each.replace("_", "-") for each in options).items():
        if times > 1 and option not in lists:
            raise InputError(f"{option} is given {times} times: give it once")


def _class_of(name: str) -> type[Command]:
    """Import and return the class of a command."""
    command: type[Command] = getattr(import_module(COMMANDS[name]), name.capitalize())
    return command


def _any_command(whole: bool) -> Any:
    """Return all commands, each with its first line; whole: with their options, which takes longer.

    Without options no module of a command is imported, so that `--help` is quick.
    """
    return Union[  # noqa: UP007
        tuple(
            Annotated[
                _class_of(name) if whole else make_dataclass(name, ()),
                subcommand(name, description=_summary(name)),
            ]
            for name in COMMANDS
        )
    ]


def _summary(name: str) -> str:
    """Return the first line of a command's docstring, read from its source."""
    place = COMMANDS[name].removeprefix("validation.").replace(".", "/")
    source = (Path(__file__).parent / f"{place}.py").read_text(encoding="utf-8")
    _, _, words = source.partition(f'class {name.capitalize()}:\n    """')
    return words.partition("\n")[0]


def _words_of(refusal: str) -> str:
    """What tyro says in a box of several lines: below its title, above the first rule after it."""
    parts = re.split(r"[─-]{4,}", re.sub(r"[│╰╯]", " ", refusal.partition("\n")[2]))
    words = next(" ".join(part.split()) for part in parts if part.strip())
    if re.match("Unrecognized options: [^-]", words):
        words += "; names stand together, and values of one option have commas between them"
    return words
