"""The tangent of the contact engine's map: all Lyapunov exponents, limit cycles.

The map: from a state on the constraints, an attitude and M, a ball rolls for a stretch and is read
back. γ and M in frame axes, the paper's six numbers, are what a turn about the vertical leaves of
that. A deviation is a small turn in frame axes [rad] and a change of M, world, over |M|: six
numbers, of which a rubber ball, whose M is horizontal by (3.1), has five. The tangent is taken by
central differences. Composed with QR along a motion it gives the exponents (Benettin, Galgani,
Giorgilli and Strelcyn, Meccanica 15, 1980; Geist, Parlitz and Lauterborn, Progress of Theoretical
Physics 83, 1990), and round a closed motion the multipliers. The equations have the same map, and
their tangent is taken alike.

Along the motion, about the vertical (in place of γ², which is 1 of every attitude), and with M²
and (M, γ), which are constant, deviations do not grow: of the six exponents four are 0.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from robotball import Scene, Settings, load_scene
from robotball import preset as settings_of
from robotball.dynamics.cycles import Flow, tangent
from robotball.dynamics.long_run import ANY_TURN, Exponents, exponents_of, standard_error
from robotball.dynamics.sections import (
    own_start,
    period_of,
    stroboscopic_map,
)
from robotball.engines.mujoco import LABEL
from robotball.engines.mujoco.model import Model, build
from robotball.processes import allowed, in_processes
from robotball.robot.formulas import Parameters
from robotball.rotations import Array, multiply
from robotball.theory.ensembles.orbits import (
    LONG_RUN_TOLERANCE,
    orbits,
)

from ..output import known, progress_bar
from ..study import Column, Study, table_of
from .contact_sections import (
    level_starts,
    moving_scene,
    sound_run,
)


def rolled(model: Model, duration: float, attitudes: Array, momenta: Array) -> tuple[Array, Array]:
    """Return attitudes (m, 4) and M (m, 3) after MuJoCo rolled the ball for a duration [s].

    attitudes, of the principal axes, and momenta, world: of the starts. InputError on a fault.
    """
    ends, times = [], np.array([0.0, duration])
    for q, M in zip(attitudes, momenta, strict=True):
        motion = sound_run(model, own_start(model.scene, q, M), times)
        ends.append((motion.attitude[-1], motion.momentum[-1]))
    last, M = (np.array(each) for each in zip(*ends, strict=True))
    return multiply(last, model.scene.principal_quaternion), M


def integrated(
    parameters: Parameters, duration: float, attitudes: Array, momenta: Array
) -> tuple[Array, Array]:
    """Return the same by the equations."""
    times = np.array([0.0, duration])
    return orbits(parameters, attitudes, momenta, times).attitudes[:, -1], momenta


@dataclass(frozen=True)
class _Growth:
    """How deviations from n motions grow in s stretches, k of them kept apart by QR.

    stretch s; momenta (n, 3) kg m²/s, world; logarithms (n, s, k): of the growth, the fastest
    first; attitudes (n, s, 4) at the beginnings, along (n, s, 6, k): the deviations there.
    """

    stretch: float
    momenta: Array
    logarithms: Array
    attitudes: Array
    along: Array

    @property
    def spectra(self) -> Array:
        """Return the six exponents (n, 6) of each motion, in the order of their means [1/s].

        Exponents that were not computed are 0. For a rubber ball that is the one of (M, γ) = 0
        (3.1).
        """
        found = self.logarithms.mean(axis=1) / self.stretch
        six = np.pad(found, ((0, 0), (0, 6 - found.shape[1])))
        return six[:, np.argsort(-six.mean(axis=0))]

    def ends(self, last: int = 5) -> Exponents:
        """Return the first exponent, and the sum of those from `last` on."""
        # In two halves, whose difference says how sure the mean is.
        parts = np.array_split(self.logarithms[:, :, 0] / self.stretch, 2, axis=1)
        halves = np.stack([part.mean(axis=1) for part in parts], axis=1)
        divergence = halves.mean(axis=1) + self.spectra[:, last:].sum(axis=1)
        return Exponents(halves, divergence, self.logarithms.shape[1] * self.stretch)

    def by_equations(self, parameters: Parameters) -> tuple[Array, float]:
        """Return `logarithms` and the mean divergence [1/s] by the equations.

        Of the same deviations from the same states, stretch by stretch.
        """
        states = self.attitudes.reshape(-1, 4), self.momenta.repeat(self.along.shape[1], axis=0)
        along = self.along.reshape(-1, *self.along.shape[2:])
        images = tangent(partial(integrated, parameters, self.stretch), *states, along)[1]
        # The means begin as soon as they may.
        divergence = exponents_of(parameters, *states, self.stretch, transient=1e-9).divergence
        logarithms = _logarithms(np.linalg.qr(images)[1]).reshape(self.logarithms.shape)
        return logarithms, float(divergence.mean())


def growth(
    flow: Flow, stretch: float, skipped: int, count: int, k: int, starts: tuple[Array, Array],
    scale: float | None = None
) -> _Growth:  # fmt: skip
    """Follow k deviations of n motions over `count` stretches [s] after some that are skipped.

    starts: attitudes (n, 4) and momenta (n, 3), as `rolled` takes them. After every stretch a
    motion is put back on the constraints, with the M that it started from: a contact model slips
    and spins a little, and its M drifts to levels that are not of interest. With a scale
    [kg m²/s] of changes of M, which then is no constant, it goes on with the M that it has.
    """
    attitudes, momenta = starts
    # Changes of M first: begun with turns, which keep M, the others would fall in behind too late.
    first = np.eye(6)[:, k - 1 :: -1]
    first[:3, -1] = ANY_TURN
    along, found = np.tile(first, (len(attitudes), 1, 1)), []
    for _ in range(skipped + count):
        began = attitudes, along
        (attitudes, ends), images = tangent(flow, attitudes, momenta, along, scale)
        momenta = momenta if scale is None else ends
        along, R = np.linalg.qr(images)
        found.append((_logarithms(R), *began))
    late = zip(*found[skipped:], strict=True)
    return _Growth(stretch, starts[1], *(np.stack(each, axis=1) for each in late))


def _logarithms(R: Array) -> Array:
    return np.log(np.abs(np.diagonal(R, axis1=1, axis2=2)))


def growths(
    scene: Scene,
    flow: Flow,
    stretch: float,
    skipped: int,
    count: int,
    starts: tuple[Array, Array],
    progress: Callable[[float], object] = lambda part: None,
    deviations: int | None = None,
) -> _Growth:
    """Return a scene's `growth` by a flow, on all cores, of some deviations, or of all there are.

    Raises InputError where the flow does, as `rolled` does on a fault.
    """
    k = deviations or (5 if scene.rolling == "rubber" else 6)
    scale = None if scene.keeps_momentum else scene.momentum_scale
    one = partial(growth, flow, stretch, skipped, count, k, scale=scale)
    parts = []
    for part in in_processes(one, [(q[None], M[None]) for q, M in zip(*starts, strict=True)]):
        parts.append((part.logarithms, part.attitudes, part.along))
        progress(len(parts) / len(starts[0]))
    return _Growth(stretch, starts[1], *map(np.concatenate, zip(*parts, strict=True)))


_Mean = tuple[str, float, float | None]
"""A row: a name, a mean and its standard error, if that is known."""
_STRETCH = 10.0  # s: the fastest deviations grow by e^3.4, the slowest shrink no more than that
_BATCH = 16  # starts a core followed at once, between two moves of the progress bar


def exponents_study(
    name: str, starts: int, duration: float, transient: float, preset: str | None, seed: int
) -> Study:
    """Measure the exponents of a scene."""
    scene = load_scene(name)
    settings = None if preset is None else settings_of(preset)
    if not scene.steady or scene.not_reduced:
        return _of_map(scene, settings, starts, seed, duration, transient)
    scene = moving_scene(name, "an exponent")
    attitudes, momenta = level_starts(scene, starts, seed)
    parts, together = [], _BATCH * allowed()
    with progress_bar(starts) as progress:
        for i in range(0, starts, together):
            progress(i, f"{scene.name}: equations")
            some = attitudes[i : i + together], momenta[i : i + together]
            parts.append(exponents_of(scene.parameters, *some, duration, transient))
    found = Exponents(
        np.concatenate([part.halves for part in parts]),
        np.concatenate([part.divergence for part in parts]),
        duration,
    )
    rows = [
        ("λ₁ [1/s]", found.mean[0], found.error[0]),
        ("λ₆ [1/s]", found.mean[1], found.error[1]),
        ("sum [1/s]", float(found.divergence.mean()), None),
        ("dimension of the section", found.dimension, found.dimension_error),
    ]
    record: dict[str, Any] = {
        "scene": scene.name,
        "starts": starts,
        "seed": seed,
        "duration": duration,
        "largest": found.largest.tolist(),
        "smallest": found.smallest.tolist(),
        "dimension": found.dimension,
    }
    if settings is not None:
        skipped = round(min(100.0, transient) / _STRETCH)
        taken = _STRETCH, skipped, max(1, round(duration / 10 / _STRETCH))
        flow = partial(rolled, build(scene, settings), _STRETCH)
        by = f"{LABEL.name}, {settings.name}"
        own, spectra = _spectra(scene, {by: flow}, taken, (attitudes, momenta))
        rows += own
        record |= {"engine": LABEL.name, "engine_duration": duration / 10}
        record["engine_exponents"] = spectra[by]
    return _study(rows, record)


def _of_map(
    scene: Scene,
    settings: Settings | None,
    count: int,
    seed: int,
    duration: float,
    transient: float,
) -> Study:
    """Measure all exponents of the stroboscopic map of a scene that is driven periodically."""
    period, starts = period_of(scene), level_starts(scene, count, seed)
    taken = period, round(transient / period), max(1, round(duration / period))
    flows: dict[str, Flow] = {
        "equations": partial(stroboscopic_map, scene, rtol=LONG_RUN_TOLERANCE)
    }
    if settings is not None:
        model = build(scene, settings)
        flows[f"{LABEL.name}, {settings.name}"] = partial(rolled, model, period)
    rows, spectra = _spectra(scene, flows, taken, starts)
    return _study(rows, {"scene": scene.name, "period": period, "exponents": spectra})


def _spectra(
    scene: Scene,
    flows: Mapping[str, Flow],
    taken: tuple[float, int, int],
    starts: tuple[Array, Array],
) -> tuple[list[_Mean], dict[str, Any]]:
    """Return rows of the six exponents by each flow, and those of every start.

    taken: the stretch [s], how many are skipped and how many are followed.
    """
    rows: list[_Mean] = []
    spectra: dict[str, Any] = {}
    count = len(starts[0])
    with progress_bar(count * len(flows)) as progress:
        for i, (by, flow) in enumerate(flows.items()):

            def say(part: float, done: int = count * i, by: str = by) -> None:
                words = f"{scene.name}: {by}, {taken[2]} stretches of {taken[0]:.3g} s"
                progress(done + count * part, words)

            say(0.0)
            found = growths(scene, flow, *taken, starts, say).spectra
            spectra[by] = found.tolist()
            for index, each in zip("₁₂₃₄₅₆", found.T, strict=True):
                name = f"λ{index} by {by} [1/s]"
                rows.append((name, float(each.mean()), standard_error(each)))
    return rows, spectra


def _study(rows: Sequence[_Mean], record: dict[str, Any]) -> Study:
    columns = (
        Column("", "name", words=True),
        Column("mean", "mean", form=".6g"),
        Column("standard error", "error", form=".1g"),
    )
    numbers = [{"name": name, "mean": mean, "error": known(of)} for name, mean, of in rows]
    table = table_of(columns, numbers)
    return Study(record["scene"], None, ["exponents"], numbers, record, [table])
