"""Results of the paper that no figure shows, by the equations and by the contact engine.

`robotball results` runs the parts of this list as cells of a sweep. A part returns rows of plain
data: a result with its place in the paper, a quantity with its unit, its value by the equations and
by the contact engine with the preset of that run, how far apart they are, and what decides that.

*Rates.* Near an equilibrium a small displacement x obeys dx/dt = Jx. One along an eigenvector of J
grows as exp(λt): its part along that vector, taken by the left eigenvector, has a logarithm of
slope Re λ and a phase of slope Im λ. Half the difference of the motions from opposite displacements
is free of the even powers of x, and of what both motions share.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from robotball import Motion, Scene, design, integrate, load_scene, preset, sample_times
from robotball.engines.mujoco import LABEL
from robotball.engines.reduced import LABEL as EQUATIONS
from robotball.equations import speed_bound
from robotball.qualitative import equilibria, long_run, straight_motions
from robotball.qualitative.normal_forms import flow_near, linear_part
from robotball.qualitative.portraits import spread_points
from robotball.qualitative.sections import own_start
from robotball.rotations import Array, multiply, normalised, tangents, turn_between, turned
from robotball.scene import Start, along_momentum
from robotball.variations import gyrostat
from validation.options import AGREES, DISAGREES, Names, Sweep, SweepOptions, chosen, listed
from validation.output import panels, write_text
from validation.studies import contact_sections as sections
from validation.studies.contact_sections import by_contact, level_starts
from validation.studies.contact_tangent import compared, exponents_by_both, limit_cycles_by_both
from validation.study import Column, Row, Study, compiled_motion, markdown, scene_cell, table_of
from validation.sweeps import Cell

_Rows = Iterator[dict[str, Any]]
_Run = Callable[[Scene, Array], Motion]
_LINE: Callable[..., dict[str, Any]] = compared  # of values that often come in pairs
_SMALL = 1e-5  # rad, of a displacement: what its cube leaves of a rate is below the steps' errors
_FOLDS, _TURNS = 3.0, 60.0  # of growth by e, or rad of turning, over which a rate is fitted
_ROOM = 5.0  # folds of the fastest growth, which magnify what a step is off
_NO_RATE = 1e-9  # 1/s: an eigenvalue below it is along a family of equilibria
_PERIOD, _ITERATIONS = 2.6, 6  # s, of a closed orbit, about; of Newton's method, to rounding
_CLOUDS = 100  # of the equations: one is the reference, the others its peers
_SETTLED = np.array([0.0, 100.0])  # s
_BEFORE = 2e-4  # of K₃ where two equilibria meet, kg m²/s
_SIDES = 2e-3  # of f*, (kg m²/s)²: between so near values the growth is a straight line


_BALANCED, _FAST = (partial(by_contact, preset(name)) for name in ("balanced", "fast"))


def rates(line: Any, linear: Array, displaced: Callable[[Array, Array], Array]) -> _Rows:
    """Yield each eigenvalue of `linear` (k, k) beside the rate of motion along its vector [1/s].

    line: makes a row; displaced: returns the displacements (n, k) at times (n,) that a first one
    (k,) becomes. Of conjugate eigenvalues the upper one is measured, and none that is zero.
    """
    words = f"step; rounding over {_SMALL:g} rad"
    values, vectors = np.linalg.eig(linear)
    for value, vector, dual in zip(values, vectors.T, np.linalg.inv(vectors), strict=True):
        # A conjugate is the same motion; along a family of equilibria nothing grows.
        if value.imag < 0 or abs(value) < _NO_RATE:
            continue
        turning, fastest = abs(value.imag) * _FOLDS / _TURNS, values.real.max() * _FOLDS / _ROOM
        end = _FOLDS / max(abs(value.real), turning, fastest)
        times, x = np.linspace(0.0, end, 201), _SMALL * normalised(vector.real)
        part = (displaced(x, times) - displaced(-x, times)) @ dual / 2
        for name, logarithm in (("real", np.log(np.abs(part))), ("imag", np.angle(part))):
            if name == "real" or value.imag:
                # A fit over all times, not a quotient of two, so that steps' errors average.
                slope = float(np.polyfit(times, np.unwrap(logarithm), 1)[0])
                which = f"{name.title()[:2]} λ" if value.imag else "λ"
                yield line(which, "1/s", float(getattr(value, name)), slope, 1e-6, words)


def _equilibria(quick: bool) -> _Rows:
    """Yield the equilibria from rest of Figs 5 to 8, one of each pair γ, -γ.

    Each stays, and is left or approached at its eigenvalues. With Ω and K reversed the flow (4.1)
    runs back in time, and has the types that the paper's balls lack.
    """
    balls = [("fig06", 1), ("fig06", -1), *((of, 1) for of in ("fig05b", "fig07", "fig08"))]
    for name, sign in balls[: 1 if quick else 5]:
        scene = load_scene(name)
        points = equilibria.closed_form_points(scene.parameters)
        if circle := equilibria.fixed_circle(scene.parameters):
            some = circle.at(np.array([np.pi / 4, 3 * np.pi / 4]))
            points |= dict(zip(("Σ_s", "Σ_u"), some, strict=True))
        scene = scene.with_hinges(command=[sign * drive.rate(0.0) for drive in scene.drives])
        for point, gamma in points.items():
            if point[-1] not in "₂₄₆" and not (quick and point != "θ₃"):
                yield from _equilibrium(scene, point + " reversed" * (sign < 0), gamma, quick)


def _equilibrium(scene: Scene, name: str, gamma: Array, quick: bool) -> _Rows:
    family = {"Σ_s": "attracts", "Σ_u": "repels"}  # whose other eigenvalue is zero
    kind = family.get(name) or equilibria.fixed_point_at(scene.parameters, gamma).kind
    line = partial(_LINE, f"{name}, {kind}", f"4, {scene.title.split('(')[-1][:-1]}", "balanced")
    near, times = partial(_beside_point, scene, gamma), np.linspace(0.0, 10.0, 101)
    left = np.linalg.norm(near(_BALANCED, np.zeros(2), times), axis=1).max()
    yield line("left in 10 s by", "rad", 0.0, float(left), 1e-5, "step, magnified by e^λt")
    yield from rates(line, equilibria.jacobian(scene.parameters, gamma), partial(near, _BALANCED))
    if kind.startswith("slow"):
        last = np.array([0.0, 20.0 if quick else 100.0])
        ends = (near(run, np.array([0.2, 0.0]), last)[1] for run in (compiled_motion, _BALANCED))
        words = f"distance after {last[1]:g} s, from 0.2"
        yield line(words, "rad", *map(float, map(np.linalg.norm, ends)), 1e-5, "step")


def _beside_point(scene: Scene, gamma: Array, run: _Run, x: Array, times: Array) -> Array:
    """Return γ's displacements (n, 2) from an equilibrium (3,) in a motion from one of x (2,)."""
    attitude = equilibria.attitude_at(normalised(gamma + x @ tangents(gamma)))
    motion = run(replace(scene, start=own_start(scene, attitude, np.zeros(3))), times)
    return motion.gamma @ scene.principal_axes @ tangents(gamma).T


def _straight_lines(quick: bool) -> _Rows:
    """Yield the rates beside straight lines, P₃ by them, and where σ₋ loses its stability.

    P₃ is (5.2). Its free term is positive, Prop. 4, and so are the others of Routh and Hurwitz,
    (5.4), where the line is stable.
    """
    scene = load_scene("fig10")
    ball, name = scene.parameters, partial(straight_motions.name_of_line, scene.parameters)
    lines = partial(straight_motions.straight_motions, ball)
    limit = float(straight_motions.stability_limit(ball) or np.nan)
    levels = [(f, own) for f in (2.0, 3.0) for own in lines(f)]
    for level, own in levels[1:2] if quick else levels:  # σ₊
        line = partial(_LINE, f"{name(own.gamma)}, f = {level:g}", "5.1, Fig. 10", "balanced")
        rows = [*_line_rates(line, scene, own)]
        yield from rows
        both, words = (own.polynomial, _polynomial(rows)), "that of the rates"
        yield line("c₂ of P₃", "1/s", *(c[1] for c in both), 1e-5, words)
        yield line("c₀ of P₃", "1/s³", *(c[3] for c in both), 1e-5, words)
        yield line("c₂c₁ - c₀ of P₃", "1/s³", *(c[1] * c[2] - c[3] for c in both), 1e-5, words)
    # Both sides of f*, whose growths have opposite signs: the chord between them crosses zero at
    # f*.
    sides, growth = (limit - _SIDES, limit + _SIDES), []
    for f in sides:
        own = next(each for each in lines(f) if name(each.gamma) == "σ₋")
        line = partial(_LINE, f"σ₋, f = {f:.7f}", "5.1, Fig. 10", "balanced")
        rows = [*_line_rates(line, scene, own)]
        growth += [row["contact"] for row in rows if "Re" in row["quantity"]]
        yield from rows
    line = partial(_LINE, "σ₋, limit of stability", "5.1, (5.4)", "balanced")
    words = "step; a chord for the growth over f"
    yield line("f*", "(kg m²/s)²", limit, float(np.interp(0.0, growth, sides)), 1e-5, words)


def _line_rates(line: Any, scene: Scene, own: straight_motions.StraightMotion) -> _Rows:
    """Yield the rates beside a straight line of a scene's ball."""
    linear = linear_part(flow_near(scene.parameters, own.gamma, own.momentum), 3)
    start = along_momentum(own.gamma, own.momentum)
    return rates(line, linear, partial(_beside_line, scene, start))


def _polynomial(rows: Sequence[Row]) -> Array:
    """Return the polynomial (4,), highest power first, that has the engine's rates as its roots."""
    real, above, turning = (
        [row["contact"] for row in rows if row["quantity"] == name]
        for name in ("λ", "Re λ", "Im λ")
    )
    pair = [complex(*each) for each in zip(above, turning, strict=True)]
    return np.real(np.poly([*real, *pair, *np.conj(pair)]))


def _beside_line(scene: Scene, start: Start, turn: Array, times: Array) -> Array:
    """Return the frame's turns (n, 3) from a straight motion's start, from a first one (3,)."""
    aside = turned(start.attitude, turn)
    beside = replace(scene, start=own_start(scene, aside, start.momentum))
    own = multiply(_BALANCED(beside, times).attitude, scene.principal_quaternion)
    return turn_between(start.attitude, own)


def _portraits(quick: bool) -> _Rows:
    """Yield how many starts from rest end elsewhere by the engine, and where δ₁ meets δ₃.

    Where they meet a rate of either is 0, as the root of the distance in K₃. So the product of
    both is straight over K₃.
    """
    for name in ("fig06", "fig07", "fig08")[: 1 if quick else 3]:
        scene, place = load_scene(name), f"4, Fig. {name[-1]}"
        points = equilibria.fixed_points(scene.parameters)
        attract = np.array([each.gamma for each in points if "stable" in each.kind.split()])
        starts = equilibria.attitude_at(spread_points(5 if quick else 30))
        begun = [replace(scene, start=own_start(scene, q, np.zeros(3))) for q in starts]
        # The nearest, as near a slow focus nothing arrives.
        reached = [
            [np.argmax(attract @ scene.principal_axes.T @ run(each, _SETTLED).gamma[1])
             for each in begun]
            for run in (compiled_motion, _FAST)
        ]  # fmt: skip
        line = partial(_LINE, f"basins of {len(attract)} equilibria", place, "fast")
        off = float(np.count_nonzero(np.diff(reached, axis=0)))
        words = f"of {len(starts)} starts, elsewhere after {_SETTLED[1]:g} s"
        yield line(words, "1", 0.0, off, 0.5, "a start near a border of basins")
    scene, products = load_scene("fig06"), []
    # κ₁ is straight over K₃.
    balls = [replace(scene.parameters, K=(0.0, 0.0, K3)) for K3 in (0.0, 1.0)]
    zero, one = (equilibria.kappa(each, 1) for each in balls)
    fold = (-1 - zero) / (one - zero)
    sides = fold - 2 * _BEFORE, fold - _BEFORE
    line = partial(_LINE, "δ₁ and δ₃ meet", "4.2, |κ₁| = 1", "balanced")
    for K3 in sides:
        ball = gyrostat(scene, K=np.array([0.0, 0.0, K3]))
        places, slow = equilibria.closed_form_points(ball.parameters), []
        for gamma in (places["δ₁"], places["δ₃"]):
            linear = equilibria.jacobian(ball.parameters, gamma)
            rows = rates(line, linear, partial(_beside_point, ball, gamma, _BALANCED))
            slow.append(min((row["contact"] for row in rows), key=abs))
        products.append(np.prod(slow))
    at = float(np.roots(np.polyfit(sides, products, 1))[0])
    yield line("K₃", "kg m²/s", fold, at, 1e-5, "a chord for a product of rates over K₃")


def _closed_orbits(quick: bool) -> _Rows:
    """Yield an orbit from rest with Ω = 0: it closes, and keeps (AK,γ)²/(Aγ,γ)."""
    scene = load_scene("rubber_chaplygin_gyrostat")
    attitude = equilibria.attitude_at(normalised(np.array([0.3, 0.5, 0.8])))
    scene = replace(scene, start=own_start(scene, attitude, np.zeros(3)))
    line = partial(_LINE, "closed orbit, Ω = 0", "4", "balanced")
    times, runs = sample_times(20.0 if quick else 100.0), (compiled_motion, _BALANCED)
    (period, gap), (other, missed) = (closed(run, scene, _PERIOD) for run in runs)
    yield line("period", "s", period, other, 1e-7, "step")
    yield line("γ after it, off", "rad", gap, missed, 1e-7, "step")
    A, K = np.array(scene.parameters.A), np.array(scene.parameters.K)
    gammas = (run(scene, times).gamma @ scene.principal_axes for run in runs)
    kept = [(gamma @ (A * K)) ** 2 / (gamma**2 @ A) for gamma in gammas]
    spread = [float(np.ptp(each) / each[0]) for each in kept]
    yield line(f"(AK,γ)²/(Aγ,γ), spread over {times[-1]:g} s", "1", *spread, 1e-6, "step")


def closed(run: _Run, scene: Scene, period: float) -> tuple[float, float]:
    """Return the period near a given one [s], and by how far γ then misses its start [rad].

    By Newton's method on how far γ is ahead along its way: it need not meet its start.
    """
    for _ in range(_ITERATIONS):
        motion = run(scene, np.array([0.0, period]))
        gap = motion.gamma[1] - motion.gamma[0]
        rate = np.cross(motion.gamma[1], motion.angular_velocity[1])
        period -= float(gap @ rate / (rate @ rate))
    return period, float(np.linalg.norm(gap))


def _long_runs(quick: bool) -> _Rows:
    """Yield Fig. 14's drift over 4000 s, and how fast a ball gets with either kind of drive."""
    for name, seconds in (("fig14", 4000.0), ("wobbling_drive", 1000.0)):
        scene, times = load_scene(name), sample_times(seconds / 100 if quick else seconds)
        theory = (compiled_motion if scene.steady else integrate)(scene, times)
        motions = theory, _FAST(scene, times)
        line = partial(_LINE, f"{scene.title}, {times[-1]:g} s", "3.3", "fast")
        if scene.steady:
            # The drift of one run is a sample: what runs of the equations scatter says how near two
            # may be.
            starts = level_starts(scene, 64, seed=0)
            many = long_run.drift(scene.parameters, *starts, float(times[-1]))
            for i, axis in enumerate("XY"):
                spread = float(many.velocities[:, i].std(ddof=1))
                both = float(many.mean[i]), float(motions[1].contact_point[-1, i] / times[-1])
                words = f"statistics: ± {spread:.2g} of one run of the equations"
                yield line(f"drift along {axis}", "m/s", *both, 4 * spread, words)
        size = np.array([np.linalg.norm(scene.start.momentum)])
        # Of drives that swing the bound is the largest over the times, as K and Ω enter it.
        balls = map(scene.parameters_at, times[: 1 if scene.steady else 1000])
        # By (2.1) the contact point moves at a|ω - Ω| at most.
        bound = max(b.a * (float(speed_bound(b, size)[0]) + np.linalg.norm(b.Omega)) for b in balls)
        speeds = [np.linalg.norm(np.diff(each.contact_point, axis=0), axis=1) for each in motions]
        words, quarter = f"chaos; M² bounds both by {bound:.0f} m/s", len(times) // 4
        for which, part in (("first", slice(quarter)), ("last", slice(-quarter, None))):
            fastest = (float(each[part].max() / times[1]) for each in speeds)
            yield line(f"largest speed, {which} quarter", "m/s", *fastest, 0.1 * bound, words)
        kept = (float(np.linalg.norm(each.momentum[-1]) / size[0]) for each in motions)
        yield line("|M|, end over start", "1", *kept, 1e-2, "step")


def _classical_section(quick: bool) -> _Rows:
    """Yield how the classical ball's chaotic section ranks among those that the equations drew."""
    scene = load_scene("classical_chaotic")
    recipe = sections.Recipe(f=25.0, starts=4 if quick else 50, skipped=8, count=20, c=3.0)
    cloud = partial(sections.cloud_by_equations, scene.parameters, recipe)
    # Clouds of the equations by other seeds: the same recipe, so that the rank is even if MuJoCo is
    # right.
    reference, *peers = (cloud(seed).states for seed in range(1, _CLOUDS + 1))
    points, _ = sections.cloud_by_contact(scene, preset("fast"), recipe, seed=0)
    rank = sections.rank_probability(points.states, peers, reference)
    line = partial(_LINE, "classical ball, chaos", "3.2, section g = 0", "fast")
    yield line("rank of its section", "1", 0.5, rank, 0.49, "chance: even between 0 and 1")


def _drift(quick: bool) -> _Rows:
    """Yield the largest difference of the drifts along OX over |Ω|, with all of them.

    The ball of Fig. 11a, with bodies designed for its A and K at each Ω along its own. It has
    several attractors, so that the equations begin where the engine is after the transient.
    """
    scene, found = load_scene("fig12"), []
    ball, times = scene.parameters, np.array([0.0, 50.0, 100.0] if quick else [0.0, 400.0, 1200.0])
    for speed in np.linspace(0.5, 4.0, 3 if quick else 15).tolist():
        bodies = design(ball.A, (0.0, 0.0, speed), ball.K, ball.a, scene.ball.mass)
        other = replace(scene, ball=bodies.ball)
        for start in zip(*level_starts(other, 2 if quick else 6, seed=0), strict=True):
            begun = replace(other, start=own_start(other, *start))
            run, duration = _FAST(begun, times), float(times[2] - times[1])
            # M as it was at the start, as its drift over the transient would lead to another level.
            late = replace(other, start=Start(run.attitude[1], begun.start.momentum))
            theory = compiled_motion(late, np.array([0.0, duration]))
            # OX is the world's X: M is against it.
            moved = theory.contact_point[1, 0], run.contact_point[2, 0] - run.contact_point[1, 0]
            found.append([speed, *(float(each / duration) for each in moved)])
    worst = max(found, key=lambda each: abs(each[1] - each[2]))
    line = partial(_LINE, "drift along OX over |Ω|", "5.3", "fast")
    words = f"largest difference, at {worst[0]:g} rad/s", "m/s", *worst[1:]
    yield line(*words, 1e-2, "step, half by what it takes of M") | {"drifts": found}


def _results_picture(drifts: Array) -> Figure:
    """Draw the drifts over |Ω| by both: rows of |Ω|, the equations', the engine's."""
    words = "The same drift by both; two values where a start decides between attractors"
    figure, axes = panels(words, (8.0, 5.0))
    for i, of, size, alpha in ((1, EQUATIONS, 13, 0.5), (2, LABEL, 5, 1.0)):
        style: Any = {"color": of.colour, "ms": size, "alpha": alpha, "mew": 0, "label": of.name}
        axes.plot(drifts[:, 0], drifts[:, i], "o", **style)
    axes.set(xlabel="|Ω| [rad/s]", ylabel="mean drift along OX [m/s]")
    axes.set_title(
        "A = diag(.7, .6, .8), K = (2, 2, 0), M² = 25 (SI); darker: more starts", fontsize=10
    )
    axes.legend(frameon=False)
    return figure


PARTS: dict[str, Callable[[bool], Iterable[Row]]] = {
    "equilibria": _equilibria, "portraits": _portraits, "closed-orbits": _closed_orbits,
    "straight-lines": _straight_lines, "long-runs": _long_runs, "drift": _drift,
    "classical-section": _classical_section,
    "limit-cycles": limit_cycles_by_both, "exponents": exponents_by_both,
}  # fmt: skip
_SCENES = ("fig05b", "fig06", "fig07", "fig08", "fig10", "fig12", "fig13", "fig14",
           "wobbling_drive", "classical_chaotic", "rubber_chaplygin_gyrostat")  # fmt: skip
_LIMIT = 1800.0  # s, of a part
_COLUMNS = (
    Column("result", lambda row: f"{row['result']} ({row['where']})", words=True),
    Column("quantity", lambda row: f"{row['quantity']} [{row['unit']}]", words=True),
    Column("equations", "equations", form=".8g"),
    Column(f"{LABEL.name}, preset", lambda row: f"{row['contact']:.8g}, {row['preset']}"),
    Column("apart", "apart"),
    Column("what decides", "decides", words=True),
)


def measure_part(cell: Cell) -> dict[str, Any]:
    """Return the rows of a part."""
    return {"rows": [*PARTS[cell["part"]](cell["quick"])]}


def holds(row: Row) -> bool:
    """Return whether both values of a row are as near as its bound asks, where it has one."""
    return bool(row["apart"] <= row.get("bound", np.inf))


def tables(parts: Mapping[str, Sequence[Row]]) -> str:
    """Return the tables of docs/results.md, one a part, in Markdown."""
    lines: list[str] = []
    for name, rows in parts.items():
        lines += ["", f"### {name.replace('-', ' ').capitalize()}", "", *markdown(_COLUMNS, rows)]
    return "\n".join(lines) + "\n"


@dataclass(frozen=True)
class Results:
    """Check the paper's results that no figure shows, by the equations and by an engine.

    Example: robotball results --quick --only closed-orbits
    """

    only: Names = ()
    """Parts to run, of equilibria, portraits, closed-orbits, straight-lines, long-runs, drift,
    classical-section, limit-cycles and exponents; all if not given."""
    sweep: SweepOptions = field(default_factory=Sweep)

    def run(self) -> int:
        names, quick = listed(self.only), self.sweep.quick
        chosen("part", names, PARTS)
        # A cell knows its balls, so that a changed scene file makes its result anew.
        shared = {"quick": quick, "balls": [scene_cell(name, 0)["digest"] for name in _SCENES]}
        cells = [{"part": name, **shared} for name in PARTS if not names or name in names]
        results = self.sweep.results(measure_part, cells, "results", _LIMIT)
        failed = [f"{each.cell['part']}: {each.failure}" for each in results if each.failure]
        parts = {each.cell["part"]: each.record["rows"] for each in results if each.record}
        rows = [row for some in parts.values() for row in some]
        picture = [_results_picture(np.array(row["drifts"])) for row in rows if "drifts" in row]
        table = table_of(_COLUMNS, rows, lambda row: not holds(row), "result")
        study = Study("results", LABEL, [], rows, {"parts": parts}, [table, *failed], *picture)
        self.sweep.present(study, *names)
        write_text(self.sweep.out / "results.md", tables(parts))
        return AGREES if all(map(holds, rows)) and not failed else DISAGREES
