"""The largest Lyapunov exponent of the contact model, and the command that measures exponents.

Two motions of the contact model run side by side. After every interval both are put back on the
constraints, with the momentum that they started from, and the second is brought back to a small
distance from the first: a contact model has motions of its own, slipping and spinning, and other
levels of M², which are not of interest.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table
from scipy.spatial.transform import Rotation

from robotball import preset
from robotball.engines.ensembles.orbits import Starts
from robotball.engines.ensembles.steppers import DEVIATION
from robotball.engines.mujoco import LABEL
from robotball.engines.mujoco.model import Model, build
from robotball.equations import Parameters
from robotball.processes import allowed
from robotball.qualitative.long_run import Exponents, exponents, standard_error
from robotball.rotations import Array, conjugate, multiply
from validation.options import AGREES, File, Preset, SceneName, Threads
from validation.output import print_whole, progress_bar, write_record
from validation.studies.contact_sections import level_starts, moving_scene, own_start, sound_run

_SEPARATION = 1e-6  # rad: its square is lost in the ratio, and so is rounding over it
_PAIR_TOLERANCE = 1e-11  # of a step of the equations alongside


@dataclass(frozen=True)
class _ContactExponent:
    """How n pairs of motions of the contact model came apart, in k intervals each.

    growth (n, k): the logarithm of the distance's growth in each interval; interval s; attitudes
    (n, k, 4), of the first motion when an interval began, turns (n, k, 3), the unit direction
    of the second from there; both in principal axes; momenta (n, 3) kg m²/s, world.
    """

    growth: Array
    interval: float
    attitudes: Array
    turns: Array
    momenta: Array

    @property
    def mean(self) -> float:
        """Return λ₁ over all pairs and intervals [1/s]."""
        return float(self.growth.mean() / self.interval)

    @property
    def error(self) -> float:
        """Return the standard error of `mean`, from the scatter of the pairs [1/s]."""
        return standard_error(self.growth.mean(axis=1) / self.interval)

    @property
    def duration(self) -> float:
        """Return the time of all pairs together [s]."""
        return self.growth.size * self.interval


def contact_exponent(
    model: Model,
    attitudes: Array,
    momenta: Array,
    duration: float,
    transient: float = 100.0,
    interval: float = 5.0,
    progress: Callable[[float], None] | None = None,
) -> _ContactExponent:
    """Measure λ₁ of the motions from n starts, each over `duration` after a `transient` [s].

    attitudes (n, 4), momenta (n, 3): in principal axes, as `qualitative.long_run` takes them.
    Raises InputError where a run has a fault.
    """
    skipped, kept = round(transient / interval), max(1, round(duration / interval))
    growth = np.empty((len(attitudes), skipped + kept))
    origins, turns = np.empty((*growth.shape, 4)), np.empty((*growth.shape, 3))
    for i, (q, M) in enumerate(zip(attitudes, momenta, strict=True)):
        turn = np.array([0.6, 0.48, 0.64])
        for k in range(skipped + kept):
            origins[i, k], turns[i, k] = q, turn
            aside = Rotation.from_rotvec(_SEPARATION * turn).as_quat(scalar_first=True)
            beside = multiply(q, aside)
            q, other = (_rolled(model, each, M, interval) for each in (q, beside))
            apart = multiply(conjugate(q), other)
            turn = Rotation.from_quat(apart, scalar_first=True).as_rotvec()
            distance = float(np.linalg.norm(turn))
            growth[i, k], turn = np.log(distance / _SEPARATION), turn / distance
            if progress is not None:
                progress((i * growth.shape[1] + k + 1) / growth.size)
    late = slice(skipped, None)
    return _ContactExponent(growth[:, late], interval, origins[:, late], turns[:, late], momenta)


def _rolled(model: Model, attitude: Array, momentum: Array, duration: float) -> Array:
    """Return the attitude (4,), principal axes, to which MuJoCo rolls the ball in `duration` s."""
    start = own_start(model.scene, attitude, momentum)
    motion = sound_run(model, start, np.array([0.0, duration]))
    return multiply(motion.attitude[-1], model.scene.principal_quaternion)


def growth_by_equations(parameters: Parameters, contact: _ContactExponent) -> Array:
    """Return `growth` (n, k) by the equations, from the same starts in the same directions."""
    n, k = contact.growth.shape
    starts = Starts(
        parameters, contact.attitudes.reshape(-1, 4), np.repeat(contact.momenta, k, axis=0)
    )
    rest = np.concatenate([contact.turns.reshape(-1, 3), np.zeros((n * k, 2))], axis=1)
    states, _ = starts.march(DEVIATION, rest, np.array([contact.interval]), _PAIR_TOLERANCE)
    return states[:, 0, 7].reshape(n, k)


_BATCH = 16  # starts a core followed at once, between two moves of the progress bar


@dataclass(frozen=True)
class Lyapunov:
    """Measure a scene's Lyapunov exponents, by the equations and, on request, by an engine.

    Example: robotball lyapunov fig14 --starts 4 --duration 1000
    """

    scene: SceneName
    """A name from the catalog, or a path to a TOML, MJCF or URDF file."""
    starts: int = 16
    """Random starts with the scene's M² and (M, γ); for 1 the scene's own."""
    duration: float = 10_000.0
    """Time over which each is measured [s]."""
    transient: float = 1000.0
    """Time before that [s]."""
    preset: Preset = None
    """Also measure the largest one by the engine so set, over a tenth of the duration."""
    seed: int = 0
    """Of the random starts."""
    threads: Threads = None
    json: File = None
    """Also write the results, start by start."""

    def run(self) -> int:
        scene = moving_scene(self.scene, "an exponent")
        settings = None if self.preset is None else preset(self.preset)
        attitudes, momenta = level_starts(scene, self.starts, self.seed)
        record: dict[str, object] = {"scene": scene.name, "starts": self.starts, "seed": self.seed}
        with progress_bar(self.starts * (1 if settings is None else 2)) as show:
            parts, together = [], _BATCH * allowed()
            for i in range(0, self.starts, together):
                show(i, f"{scene.name}: equations")
                some = attitudes[i : i + together], momenta[i : i + together]
                parts.append(exponents(scene.parameters, *some, self.duration, self.transient))
            found = Exponents(
                np.concatenate([part.largest for part in parts]),
                np.concatenate([part.divergence for part in parts]),
                self.duration,
            )
            rows = {
                "λ₁ [1/s]": (found.mean[0], found.error[0]),
                "λ₆ [1/s]": (found.mean[1], found.error[1]),
                "sum [1/s]": (float(found.divergence.mean()), None),
                "dimension of the section": (found.dimension, found.dimension_error),
            }
            record |= {
                "duration": self.duration,
                "largest": found.largest.tolist(),
                "smallest": found.smallest.tolist(),
                "dimension": found.dimension,
            }
            if settings is not None:
                model, what = build(scene, settings), f"{scene.name}: {LABEL.name}"
                contact = contact_exponent(
                    model, attitudes, momenta, self.duration / 10, min(100.0, self.transient), 10.0,
                    lambda part: show(self.starts * (1 + part), what),
                )  # fmt: skip
                rows[f"λ₁ by {LABEL.name}, {settings.name} [1/s]"] = (contact.mean, contact.error)
                record |= {
                    "engine": LABEL.name,
                    "engine_duration": self.duration / 10,
                    "engine_largest": (contact.growth.mean(axis=1) / contact.interval).tolist(),
                }
        table = Table("", "mean", "standard error", box=box.SIMPLE_HEAD)
        for name, (value, error) in rows.items():
            known = error is not None and np.isfinite(error)
            table.add_row(name, f"{value:.6g}", f"{error:.1g}" if known else "-")
        print_whole(table, Console())
        write_record(self.json, record)
        return AGREES
