"""Lyapunov exponents of a scene, and the attractors that random starts reach.

With periodic drives there is a stroboscopic map, which maps an attitude and M to their values one
period later. A deviation is a small rotation in frame axes [rad] and a change of M in world axes
divided by |M|. These are six numbers, or five for a rubber ball, because its M is horizontal (3.1).
QR decompositions of the map's tangent along a motion give the exponents (Benettin, Galgani,
Giorgilli and Strelcyn, Meccanica 15, 1980; Geist, Parlitz and Lauterborn, Progress of Theoretical
Physics 83, 1990). Four of the six are 0: deviations along the motion and about the vertical do not
grow, and M² and (M, γ) are constant.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from robotball import Scene, load_scene
from robotball.dynamics.cycles import Flow, tangent
from robotball.dynamics.long_run import (
    ANY_TURN,
    CHAOS,
    LINE,
    LOST,
    TORUS,
    Exponents,
    basins,
    exponents_of,
    standard_error,
)
from robotball.dynamics.sections import period_of, stroboscopic_map
from robotball.errors import check_count
from robotball.processes import allowed, in_processes
from robotball.rotations import Array
from robotball.theory.ensembles.orbits import LONG_RUN_TOLERANCE

from ..output import known, progress_bar
from ..study import Column, Study, table_of
from .contact_sections import attracted_scene, level_starts, moving_scene

_BATCH = 16  # starts per core between two updates of the progress bar
_Mean = tuple[str, float, float | None]
"""A row: a name, a mean, and its standard error if known."""


@dataclass(frozen=True)
class Growth:
    """Growth of k orthogonal deviations from n motions over s stretches of time.

    Attributes
    ----------
    stretch : float, s
        The length of a stretch.
    logarithms : (n, s, k)
        The logarithms of the growth, the fastest first.
    attitudes : (n, s, 4)
        The attitudes at the beginnings of the stretches.
    along : (n, s, 6, k)
        The deviations at the beginnings of the stretches.
    """

    stretch: float
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


def _growth(
    flow: Flow, skipped: int, count: int, k: int, scale: float | None, starts: tuple[Array, Array]
) -> tuple[Array, ...]:
    """Return the fields of `Growth` with all stretches along the first axis."""
    attitudes, momenta = starts
    # Begin with changes of M. Rotations leave M unchanged, so the last deviations would align late.
    first = np.eye(6)[:, k - 1 :: -1]
    first[:3, -1] = ANY_TURN
    along, stretches = np.tile(first, (len(attitudes), 1, 1)), []
    for _ in range(skipped + count):
        began = attitudes, along
        (attitudes, ends), images = tangent(flow, attitudes, momenta, along, scale)
        momenta = momenta if scale is None else ends
        along, R = np.linalg.qr(images)
        stretches.append((np.log(np.abs(np.diagonal(R, axis1=1, axis2=2))), *began))
    return tuple(np.stack(column, axis=1) for column in zip(*stretches[skipped:], strict=True))


def growths(
    scene: Scene,
    flow: Flow,
    stretch: float,
    skipped: int,
    count: int,
    starts: tuple[Array, Array],
    progress: Callable[[float], object] = lambda part: None,
) -> Growth:
    """Follow all deviations over `count` stretches [s] after `skipped` ones, on all cores.

    The starts are attitudes (n, 4) and momenta (n, 3). If M is constant, a motion returns to the M
    of its start after every stretch, because slip and spin of a contact model let M drift.
    """
    k = 5 if scene.rolling == "rubber" else 6
    scale = None if scene.keeps_momentum else scene.momentum_scale
    one, parts = partial(_growth, flow, skipped, count, k, scale), []
    for part in in_processes(one, [(q[None], M[None]) for q, M in zip(*starts, strict=True)]):
        parts.append(part)
        progress(len(parts) / len(starts[0]))
    return Growth(stretch, *map(np.concatenate, zip(*parts, strict=True)))


def exponents_study(name: str, starts: int, duration: float, transient: float, seed: int) -> Study:
    """Measure the exponents of a scene."""
    scene = load_scene(name)
    if not scene.steady or scene.not_reduced:
        return _of_map(scene, starts, seed, duration, transient)
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
    record = {"scene": scene.name, "starts": starts, "seed": seed, "duration": duration}
    record |= {"largest": found.largest.tolist(), "smallest": found.smallest.tolist()}
    return _study(rows, record | {"dimension": found.dimension})


def _of_map(scene: Scene, count: int, seed: int, duration: float, transient: float) -> Study:
    """Measure all exponents of the stroboscopic map of a scene that is driven periodically."""
    period, starts = period_of(scene), level_starts(scene, count, seed)
    skipped, taken = round(transient / period), max(1, round(duration / period))
    flow = partial(stroboscopic_map, scene, rtol=LONG_RUN_TOLERANCE)
    with progress_bar(count) as progress:

        def say(part: float) -> None:
            progress(count * part, f"{scene.name}: {taken} periods of {period:.3g} s")

        say(0.0)
        spectra = growths(scene, flow, period, skipped, taken, starts, say).spectra
    rows = [
        (f"λ{index} [1/s]", float(exponents.mean()), standard_error(exponents))
        for index, exponents in zip("₁₂₃₄₅₆", spectra.T, strict=True)
    ]
    return _study(rows, {"scene": scene.name, "period": period, "exponents": spectra.tolist()})


def _study(rows: Sequence[_Mean], record: dict[str, Any]) -> Study:
    columns = (
        Column("", "name", words=True),
        Column("mean", "mean", form=".6g"),
        Column("standard error", "error", form=".1g"),
    )
    numbers = [{"name": name, "mean": mean, "error": known(error)} for name, mean, error in rows]
    table = table_of(columns, numbers)
    return Study(record["scene"], None, ["exponents"], numbers, record, [table])


def basins_study(name: str, starts: int, transient: float, seed: int) -> Study:
    """Find which attractor each of many random starts reaches."""
    scene = attracted_scene(name, "a basin")
    check_count("starts", starts, 2)
    attitudes, momenta = level_starts(scene, starts, seed)
    with progress_bar(1) as progress:
        progress(0, f"{scene.name}: {starts} starts")
        found = basins(scene.parameters, attitudes, momenta, transient)
    names = {TORUS: "torus", CHAOS: "chaos", LINE: "straight line"}
    names |= {LOST: "stops crossing g = 0"}
    names |= {i: f"cycle of period {cycle.period:.6f} s" for i, cycle in enumerate(found.cycles)}
    rows = [
        {"name": word, "share": share}
        for label, word in sorted(names.items(), reverse=True)
        if (share := found.share(label)) > 0
    ]
    columns = (
        Column("attractor", "name", words=True),
        Column("share of the starts", "share", form=".3f"),
    )
    reached = [names[label] for label in found.labels.tolist()]
    record = {"scene": scene.name, "seed": seed, "transient": transient}
    record |= {"attitudes": attitudes.tolist(), "reached": reached}
    return Study(scene.name, None, ["basins"], rows, record, [table_of(columns, rows)])
