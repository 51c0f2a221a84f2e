"""The error budget: from the naive model to the recipe choice by choice, and back.

Errors hide one another. While the model is built up, an error is that of the worst choice not yet
made, and a variant can even look worse than the one before: two errors had cancelled, or what is
now felt was drowned before. What a choice is worth by itself is seen where all else is right and it
alone is undone.

The error budget as tables in the terminal and as a picture of bars, each way.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from robotball import Scene, Settings, integrate, preset
from robotball.engines.mujoco import LABEL
from robotball.engines.mujoco.engine import MUJOCO
from robotball.engines.mujoco.model import build
from robotball.engines.mujoco.run import run
from robotball.engines.mujoco.settings import NAIVE
from robotball.errors import unknown
from robotball.film.looks import INK
from robotball.rotations import Array
from validation.agreement import Agreement
from validation.output import print_whole, scientific, title
from validation.results import record
from validation.studies.timing import Cost, measure_costs, simulated_second

TIMED = 2.0  # s of the motion over which cost is measured; it hardly changes along the way
ROUNDS = 5  # of timing, all variants in turn


@dataclass(frozen=True)
class Choice:
    """One modelling choice: the fields of Settings that make it, and what it is in words."""

    name: str
    fields: tuple[str, ...]
    words: str


# Those without which nothing rolls come first, so that the smaller errors behind them are seen.
CHOICES = (
    # The solver's tolerances are relative to inertia; beside a huge one it would stop at once.
    Choice("drive", ("drive", "tolerance", "ls_tolerance"), "huge inertias, not servos"),
    Choice("friction", ("sliding_friction", "torsional_friction"), "more than the motion needs"),
    Choice("cone", ("cone",), "elliptic, not a pyramid"),
    Choice("root", ("root",), "the shell has the free joint, not the frame"),
    Choice("integrator", ("integrator",), "RK4, not Euler"),
    Choice("start", ("start_in_equilibrium",), "at the depth that carries the weight"),
    Choice("softness", ("solref", "solimp", "solreffriction", "softness"), "a stiff contact"),
    Choice("noslip", ("noslip_iterations", "noslip_tolerance"), "slip is solved for"),
    Choice(
        "solver",
        ("solver", "jacobian", "iterations", "warmstart", "island"),
        "PGS and few iterations",
    ),
    Choice("timestep", ("timestep",), "shorter than the engine's own"),
)
# A newcomer hangs the shell on the body that it is built around. At both ends a faulty run goes
# on, so that there is an error to tell, and slip is a fault from the same size on.
BOTTOM = replace(NAIVE, root="frame", stop_at_fault=False)
TOP = replace(preset("accurate"), error_tolerance=NAIVE.error_tolerance, stop_at_fault=False)


def adopt(settings: Settings, choice: Choice, of: Settings = TOP) -> Settings:
    """`settings`, but with the choice as it is made in `of`."""
    return replace(settings, **{name: getattr(of, name) for name in choice.fields})


def undo(settings: Settings, choice: Choice) -> Settings:
    """`settings`, but with the choice as a newcomer makes it."""
    return adopt(settings, choice, BOTTOM)


def without(settings: Settings, names: Iterable[str]) -> Settings:
    """`settings` with the choices of the names undone, and named so.

    Raises InputError for a name that no choice has.
    """
    known = {choice.name: choice for choice in CHOICES}
    for name in names:
        if name not in known:
            raise unknown("choice", name, known)
        settings = replace(undo(settings, known[name]), name=f"{settings.name} - {name}")
    return settings


def built_up() -> tuple[Settings, ...]:
    """The naive model, then settings that each make one choice more; each is named after it."""
    variants = [BOTTOM]
    for choice in CHOICES:
        variants.append(replace(adopt(variants[-1], choice), name=choice.name))
    return tuple(variants)


def each_undone() -> tuple[Settings, ...]:
    """The recipe, then the recipe with each choice alone undone, named after it."""
    return TOP, *(replace(undo(TOP, choice), name=choice.name) for choice in CHOICES)


@dataclass(frozen=True)
class Variant:
    """What one of the settings does to a scene, and the cost of a simulated second of it."""

    agreement: Agreement
    cost: Cost

    @property
    def name(self) -> str:
        return self.agreement.settings.name

    @property
    def slip(self) -> float:
        """The sliding velocity at the contact, root mean square, over the mean rolling speed."""
        theory = self.agreement.theory
        speed = theory.path_length / float(theory.times[-1])
        return float(np.sqrt(np.mean(self.agreement.report.slip**2))) / speed


@dataclass(frozen=True)
class Ablation:
    """Variants built up from the naive model; the recipe, and variants with one choice undone."""

    scene: Scene
    built: tuple[Variant, ...]
    undone: tuple[Variant, ...]

    @property
    def naive(self) -> Variant:
        return self.built[0]

    @property
    def recipe(self) -> Variant:
        return self.undone[0]

    def times_naive(self, variant: Variant) -> Cost:
        """The cost of a variant as ratios to that of the naive model."""
        return variant.cost.over(self.naive.cost)

    def rows(self) -> list[dict[str, Any]]:
        """A row of plain numbers for every variant; those of a run that broke off are None."""
        directions = (("built up", self.built), ("undone", self.undone))
        return [
            self._row(direction, variant)
            for direction, variants in directions
            for variant in variants
        ]

    def _row(self, direction: str, variant: Variant) -> dict[str, Any]:
        cost = self.times_naive(variant)
        return {
            "direction": direction,
            "choice": variant.name,
            "path_error": variant.agreement.path_error,
            "momentum_error": variant.agreement.momentum_error,
            "slip": variant.slip,
            "cpu_seconds": variant.cost.seconds,
            "times_naive": cost.ratio,
            "times_naive_least": cost.spread[0],
            "times_naive_most": cost.spread[1],
            "faults": "; ".join(map(str, variant.agreement.faults)),
        }

    def record(self) -> dict[str, Any]:
        """The ablation as plain data, with the settings and the faults of every variant in full."""
        variants = (*self.built, *self.undone)
        return {
            "scene": self.scene.name,
            "choices": [asdict(choice) for choice in CHOICES],
            "variants": [
                {**record(variant.agreement), **row}
                for variant, row in zip(variants, self.rows(), strict=True)
            ],
        }


def measure_ablation(
    scene: Scene,
    times: Array | None = None,
    rounds: int = ROUNDS,
    show: Callable[[float, str], None] | None = None,
) -> Ablation:
    """All variants of a scene over `times` (n,) [s] from 0, the scene's own if None.

    rounds: of timing, all variants in turn. show: told the part that is done, 0 to 1, and what is
    done next.
    """
    settings = (*built_up(), *each_undone())
    show = show or (lambda part, what: None)
    theory = integrate(scene, times)
    models = [build(scene, each) for each in settings]
    agreements = []
    total = len(models) * (rounds + 2)
    for i, model in enumerate(models):
        show(i / total, f"{scene.name}: {model.settings.name}")
        agreements.append(Agreement(theory, run(model, theory.times), MUJOCO))
    timed = theory.times[: max(2, int(np.searchsorted(theory.times, TIMED)))]
    costs = measure_costs(
        [simulated_second(model, timed) for model in models],
        rounds,
        lambda done: show((len(models) + done) / total, f"{scene.name}: timing"),
    )
    variants = tuple(Variant(*pair) for pair in zip(agreements, costs, strict=True))
    count = len(built_up())
    return Ablation(scene, variants[:count], variants[count:])


def fault_of(variant: Variant) -> str:
    """The first fault of a variant, and how many more there are; nothing where there is none."""
    faults: Sequence[object] = variant.agreement.faults
    more = f" (+{len(faults) - 1})" if len(faults) > 1 else ""
    return f"{faults[0]}{more}" if faults else ""


BUILT = "Built up, every choice made so far: the worst to come hides what is done."
UNDONE = "The recipe with one choice undone: what it is worth by itself."
NOTE = (
    "slip: sliding velocity, root mean square, over the rolling speed.\n"
    "CPU: of a simulated second. × naive: median of rounds, ± the farthest from it.\n"
    "A run with a fault is no rolling ball, whatever its numbers."
)
INCHES = (11.0, 6.2)
ERROR_AT, COST_AT = 6, 58  # points right of a panel, where its numbers stand
SOUND, FAULTY, HATCH = LABEL.colour, "white", "////"
DIAMOND: dict[str, Any] = {
    "marker": "D",
    "color": INK,
    "markerfacecolor": "w",
    "linestyle": "",
    "markersize": 5,
}


def show_ablation(ablation: Ablation, console: Console) -> None:
    """Print both tables, and what the columns mean."""
    console.print(escape(f"{ablation.scene.name}: {ablation.scene.title}"), style="bold")
    console.print(BUILT)
    print_whole(_table(ablation, ablation.built, "+ "), console)
    console.print(UNDONE)
    print_whole(_table(ablation, ablation.undone, "- "), console)
    console.print(NOTE)


def _table(ablation: Ablation, variants: Sequence[Variant], sign: str) -> Table:
    table = Table(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), show_edge=False)
    table.add_column("choice", no_wrap=True)
    for heading in ("path\nerror", "M error", "slip", "CPU\n\\[ms]", "× naive"):
        table.add_column(heading, justify="right", no_wrap=True)
    table.add_column("first fault")
    for i, variant in enumerate(variants):
        cost = ablation.times_naive(variant)
        table.add_row(
            f"{sign if i else ''}{variant.name}",
            scientific(variant.agreement.path_error),
            scientific(variant.agreement.momentum_error),
            scientific(variant.slip),
            f"{variant.cost.seconds * 1e3:.1f}",
            f"{cost.ratio:.1f} ±{max(abs(end - cost.ratio) for end in cost.spread):.1f}",
            fault_of(variant),
            style="yellow" if variant.agreement.faults else "",
        )
    return table


def ablation_picture(ablation: Ablation) -> Figure:
    """Path error (bars) and momentum error (diamonds) of every variant, its cost beside."""
    figure = Figure(figsize=INCHES, layout="constrained")
    title(figure, f"{ablation.scene.name}: {ablation.scene.title}")
    left, right = figure.subplots(1, 2, sharex=True)
    _panel(left, ablation, ablation.built, "+ ")
    _panel(right, ablation, ablation.undone, "− ")
    left.set_title("from the naive model: one choice more", loc="left", fontsize=10.5)
    right.set_title("the recipe with one choice undone", loc="left", fontsize=10.5)
    left.set_xlim(*_ends((*ablation.built, *ablation.undone)))
    handles: list[Artist] = [
        Patch(facecolor=SOUND, edgecolor=INK, label="path error"),
        Patch(facecolor=FAULTY, edgecolor=INK, hatch=HATCH, label="path error, faulty run"),
        Line2D([], [], **DIAMOND, label="momentum error"),
        Line2D([], [], color=INK, linestyle=":", label="path error of the recipe"),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=4, frameon=False)
    return figure


def _panel(axes: Axes, ablation: Ablation, variants: Sequence[Variant], sign: str) -> None:
    names = [f"{sign if i else ''}{variant.name}" for i, variant in enumerate(variants)]
    axes.set_yticks(range(len(variants)), names)
    axes.set(xscale="log", xlabel="path error and momentum error, relative")
    axes.set_ylim(len(variants) - 0.4, -0.6)
    axes.grid(axis="x", alpha=0.3)
    axes.set_axisbelow(True)
    for row, variant in enumerate(variants):
        error, off = variant.agreement.path_error, variant.agreement.momentum_error
        if error is not None:
            faulty = bool(variant.agreement.faults)
            axes.barh(
                row, error, height=0.62, edgecolor=INK,
                color=FAULTY if faulty else SOUND, hatch=HATCH if faulty else None,
            )  # fmt: skip
        if off is not None:
            axes.plot([off], [row], **DIAMOND)
        _beside(axes, row, "broke off" if error is None else scientific(error), ERROR_AT)
        _beside(axes, row, f"{ablation.times_naive(variant).ratio:.1f}", COST_AT)
    _beside(axes, -1, "path\nerror", ERROR_AT)
    _beside(axes, -1, "CPU,\n× naive", COST_AT)
    if (best := ablation.recipe.agreement.path_error) is not None:
        axes.axvline(best, color=INK, linestyle=":")


def _ends(variants: Sequence[Variant]) -> tuple[float, float]:
    """Ends of the axis, with room beyond all that is drawn; bars begin at the left one."""
    each = [
        (variant.agreement.path_error, variant.agreement.momentum_error) for variant in variants
    ]
    drawn = [value for pair in each for value in pair if value]
    return min(drawn) / 20, max(drawn) * 20


def _beside(axes: Axes, row: float, text: str, place: float) -> None:
    """A text `place` points right of the axes."""
    axes.annotate(
        text,
        (1.0, row),
        xycoords=("axes fraction", "data"),
        xytext=(place, 0),
        textcoords="offset points",
        va="center",
        fontsize=9,
        annotation_clip=False,
    )
