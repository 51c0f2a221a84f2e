"""Lyapunov exponents of the contact engine's map from its tangent.

The map takes a state on the constraints (an attitude and M), rolls the ball for a stretch of time,
and reads the state back. A deviation is a small rotation in frame axes [rad] and a change of M in
the world over |M|: six numbers, five for a rubber ball, whose M is horizontal (3.1). The tangent is
computed with central differences. QR decompositions along a motion give the exponents (Benettin,
Galgani, Giorgilli and Strelcyn, Meccanica 15, 1980; Geist, Parlitz and Lauterborn, Progress of
Theoretical Physics 83, 1990), and around a closed motion the multipliers. The equations have the
same map with the same tangent.

Four of the six exponents are 0: deviations along the motion and about the vertical do not grow, and
M² and (M, γ) are constant.
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
from robotball.theory.ensembles.orbits import LONG_RUN_TOLERANCE, orbits

from ..output import known, progress_bar
from ..study import Column, Study, table_of
from .contact_sections import (
    level_starts,
    moving_scene,
    sound_run,
)


def rolled(model: Model, duration: float, attitudes: Array, momenta: Array) -> tuple[Array, Array]:
    """Roll the ball with MuJoCo for a duration [s], and return attitudes (m, 4) and M (m, 3).

    `attitudes` of the principal axes and `momenta` in the world are the starts. Raises InputError
    if a run has a fault.
    """
    ends, times = [], np.array([0.0, duration])
    for q, M in zip(attitudes, momenta, strict=True):
        motion = sound_run(model, own_start(model.scene, q, M), times)
        ends.append((motion.attitude[-1], motion.momentum[-1]))
    last, M = map(np.array, zip(*ends, strict=True))
    return multiply(last, model.scene.principal_quaternion), M


def integrated(
    parameters: Parameters, duration: float, attitudes: Array, momenta: Array
) -> tuple[Array, Array]:
    """Integrate the equations for a duration [s], like `rolled`."""
    times = np.array([0.0, duration])
    return orbits(parameters, attitudes, momenta, times).attitudes[:, -1], momenta


@dataclass(frozen=True)
class _Growth:
    """Growth of k orthogonal deviations from n motions over s stretches.

    Attributes
    ----------
    stretch : float, s
        The length of a stretch.
    momenta : (n, 3), kg m²/s, world
        The momenta.
    logarithms : (n, s, k)
        The logarithms of the growth, the fastest first.
    attitudes : (n, s, 4)
        The attitudes at the beginnings of the stretches.
    along : (n, s, 6, k)
        The deviations at the beginnings of the stretches.
    """

    stretch: float
    momenta: Array
    logarithms: Array
    attitudes: Array
    along: Array

    @property
    def spectra(self) -> Array:
        """The six exponents (n, 6) of each motion, sorted by their means [1/s].

        Exponents that were not computed are 0, such as the exponent of (M, γ) of a rubber ball.
        """
        computed = self.logarithms.mean(axis=1) / self.stretch
        six = np.pad(computed, ((0, 0), (0, 6 - computed.shape[1])))
        return six[:, np.argsort(-six.mean(axis=0))]

    def ends(self, last: int = 5) -> Exponents:
        """Return the first exponent in two halves of the time, and the divergence."""
        parts = np.array_split(self.logarithms[:, :, 0] / self.stretch, 2, axis=1)
        halves = np.stack([part.mean(axis=1) for part in parts], axis=1)
        divergence = halves.mean(axis=1) + self.spectra[:, last:].sum(axis=1)
        return Exponents(halves, divergence, self.logarithms.shape[1] * self.stretch)

    def by_equations(self, parameters: Parameters) -> tuple[Array, float]:
        """Return `logarithms` and the mean divergence [1/s] of the equations.

        Every stretch begins with the same states and deviations.
        """
        states = self.attitudes.reshape(-1, 4), self.momenta.repeat(self.along.shape[1], axis=0)
        along = self.along.reshape(-1, *self.along.shape[2:])
        images = tangent(partial(integrated, parameters, self.stretch), *states, along)[1]
        # The means begin as soon as they may.
        divergence = exponents_of(parameters, *states, self.stretch, transient=1e-9).divergence
        logarithms = _logarithms(np.linalg.qr(images)[1]).reshape(self.logarithms.shape)
        return logarithms, float(divergence.mean())


def growth(
    flow: Flow,
    stretch: float,
    skipped: int,
    count: int,
    k: int,
    starts: tuple[Array, Array],
    scale: float | None = None,
) -> _Growth:
    """Follow k deviations of n motions over `count` stretches [s] after `skipped` ones.

    The starts are attitudes (n, 4) and momenta (n, 3), as for `rolled`. After every stretch a
    motion returns to the constraints and to the M of its start, because slip and spin of a contact
    model let M drift to other levels. If M is not constant, give the `scale` [kg m²/s] of its
    changes; the motion then continues with its current M.
    """
    attitudes, momenta = starts
    # Begin with changes of M. Rotations leave M constant, so the last deviations would align late.
    first = np.eye(6)[:, k - 1 :: -1]
    first[:3, -1] = ANY_TURN
    along, stretches = np.tile(first, (len(attitudes), 1, 1)), []
    for _ in range(skipped + count):
        began = attitudes, along
        (attitudes, ends), images = tangent(flow, attitudes, momenta, along, scale)
        momenta = momenta if scale is None else ends
        along, R = np.linalg.qr(images)
        stretches.append((_logarithms(R), *began))
    columns = zip(*stretches[skipped:], strict=True)
    return _Growth(stretch, starts[1], *(np.stack(column, axis=1) for column in columns))


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
    """Return the `growth` of a scene's deviations under a flow, by default of all, on all cores.

    Raises InputError if the flow does.
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
"""A row: a name, a mean, and its standard error if known."""
_STRETCH = 10.0  # s, in which deviations grow or shrink by at most e^3.4
_BATCH = 16  # starts per core between two updates of the progress bar


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
