"""The `robotball` command: arguments in, exit status out.

Exit status: 0 agreement within the stated bound, 1 not, 2 bad input.
"""

import contextlib
import io
import logging
import re
import sys
import warnings
from collections.abc import Sequence

import tyro

from robotball import InputError, SceneWarning
from validation.commands.arguments import BAD_INPUT
from validation.commands.basins import Basins
from validation.commands.compare import Compare
from validation.commands.convergence import Convergence
from validation.commands.demo import Demo
from validation.commands.design import Design
from validation.commands.equilibria import Equilibria
from validation.commands.extremes import Extremes
from validation.commands.figures import Figures
from validation.commands.ladder import Ladder
from validation.commands.lyapunov import Lyapunov
from validation.commands.model import Model
from validation.commands.paper import Paper
from validation.commands.portraits import Portraits
from validation.commands.replay import Replay
from validation.commands.scenes import Scenes
from validation.commands.section import Section
from validation.commands.tradeoff import Tradeoff
from validation.commands.video import Video

Command = (
    Scenes | Compare | Video | Replay | Model | Design | Demo
    | Figures | Section | Lyapunov | Basins | Equilibria | Portraits | Paper
    | Ladder | Convergence | Tradeoff | Extremes
)  # fmt: skip


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and exit with its status."""
    # The watch on every run reports what MuJoCo would only log.
    logging.getLogger("absl").setLevel(logging.ERROR)
    warnings.simplefilter("once", SceneWarning)
    warnings.showwarning = _show_warning
    try:
        status = parse(arguments).run()
    except InputError as error:
        print(f"robotball: {error}", file=sys.stderr)
        status = BAD_INPUT
    except KeyboardInterrupt:
        status = 130
    sys.exit(status)


def _show_warning(message: Warning | str, *_: object, **__: object) -> None:
    print(f"robotball: warning: {message}", file=sys.stderr)


def parse(arguments: Sequence[str] | None) -> Command:
    """The command of the arguments; raises InputError, in one line, where they make none."""
    refusal = io.StringIO()
    try:
        with contextlib.redirect_stderr(refusal):
            return tyro.cli(Command, args=arguments, prog="robotball")
    except SystemExit as leaving:
        if not leaving.code:
            raise
        # tyro draws a box of several lines; its words up to the first rule are the error.
        words = re.split(r"─{4,}\s*│?\n", re.sub(r"^╭.*\n", "", refusal.getvalue()))[0]
        raise InputError(" ".join(re.sub(r"[│╰╯]", " ", words).split())) from None
