"""The `robotball` command: arguments in, exit status out.

Exit status: 0 agreement within the stated bound, 1 not, 2 bad input, or what the system refuses.
Nothing that a command needs is imported before it runs. A character that a stream cannot show, and
a reader that goes away, end no command.
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
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Annotated, Any, Union, get_args, get_type_hints

import tyro
from tyro.conf import subcommand

from robotball.cores import at_most
from robotball.errors import InputError, SceneWarning, unknown
from robotball.files.replacing import STANDARD_OUTPUT
from validation.commands.ablation import Ablation
from validation.commands.arguments import BAD_INPUT, Names
from validation.commands.attractors import Attractors
from validation.commands.basins import Basins
from validation.commands.compare import Compare
from validation.commands.convergence import Convergence
from validation.commands.demo import Demo
from validation.commands.design import Design
from validation.commands.engines import Engines
from validation.commands.equilibria import Equilibria
from validation.commands.export import Export
from validation.commands.extremes import Extremes
from validation.commands.figures import Figures
from validation.commands.judge import Judge
from validation.commands.lyapunov import Lyapunov
from validation.commands.model import Model
from validation.commands.paper import Paper
from validation.commands.portraits import Portraits
from validation.commands.replay import Replay
from validation.commands.report import Report
from validation.commands.scenes import Scenes
from validation.commands.section import Section
from validation.commands.steer import Steer
from validation.commands.tradeoff import Tradeoff
from validation.commands.video import Video
from validation.commands.view import View


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


Command = (
    Scenes | Engines | Compare | Report | Judge | Video | View | Replay | Model | Export
    | Design | Steer | Demo
    | Figures | Section | Lyapunov | Attractors | Basins | Equilibria
    | Portraits | Paper
    | Ablation | Convergence | Tradeoff | Extremes
)  # fmt: skip


INTERRUPTED = 130
FORMER_NAMES = {"ladder": "ablation"}
COMMANDS: dict[str, type[Command]] = {each.__name__.lower(): each for each in get_args(Command)}
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
        command = COMMANDS.get(name)
        if command is None:
            raise unknown("command", name, COMMANDS)
    if command:
        _check_each_is_given_once(command, arguments)
    refusal = io.StringIO()
    try:
        with contextlib.redirect_stderr(refusal):
            if command:
                return tyro.cli(command, args=arguments[1:], prog=f"robotball {name}")
            return tyro.cli(_any_command(), args=arguments, prog="robotball", description=WHAT)
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


def _any_command() -> Any:
    """All commands, each with the first line of what it says of itself."""
    return Union[  # noqa: UP007
        tuple(
            Annotated[each, subcommand(name, description=(each.__doc__ or "").partition("\n\n")[0])]
            for name, each in COMMANDS.items()
        )
    ]


def _words_of(refusal: str) -> str:
    """What tyro says in a box of several lines: below its title, above the first rule after it."""
    parts = re.split(r"[─-]{4,}", re.sub(r"[│╰╯]", " ", refusal.partition("\n")[2]))
    words = next(" ".join(part.split()) for part in parts if part.strip())
    if re.match("Unrecognized options: [^-]", words):
        words += "; names stand together, and values of one option have commas between them"
    return words
