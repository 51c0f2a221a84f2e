"""Simulate many starts of one scene, or many scenes, with a contact engine."""

import ctypes
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, TypeVar, overload

from robotball.engines.engine import DEFAULT, Engine, Request, as_of, request_of, runnable
from robotball.engines.equations import scene_of
from robotball.errors import InputError
from robotball.motion import ContactMotion, EngineSettings, Progress
from robotball.processes import in_processes, pickled_jobs
from robotball.robot.scene import Scene, Start, Times
from robotball.rotations import Array

_Result = TypeVar("_Result")


@dataclass(frozen=True, eq=False)
class FromStarts(Sequence[Scene]):
    """Sequence of one scene with many starts. Reading an item makes its scene in 0.2 ms.

    Raises InputError for a start that is not a Start.
    """

    scene: Scene
    starts: Sequence[Start]

    def __post_init__(self) -> None:
        argument: Any = self.starts
        starts = [*argument] if isinstance(argument, Iterable) else [argument]
        for i, start in enumerate(starts):
            if not isinstance(start, Start):
                raise InputError(
                    f"starts must be Start(attitude, momentum), one or more; number {i} is "
                    f"{start!r}"
                )
        object.__setattr__(self, "starts", starts)

    def __len__(self) -> int:
        return len(self.starts)

    @overload
    def __getitem__(self, at: int) -> Scene: ...
    @overload
    def __getitem__(self, at: slice) -> "FromStarts": ...
    def __getitem__(self, at: int | slice) -> "Scene | FromStarts":
        if isinstance(at, slice):
            return FromStarts(self.scene, self.starts[at])
        return self.scene.from_start(self.starts[at])


def of_each(work: Callable[[Scene], _Result], scenes: Sequence[Scene]) -> Iterator[_Result]:
    """Yield work(scene) of each scene, from other processes if `work` can be pickled."""
    if isinstance(scenes, FromStarts):
        of_start = partial(_of_start, work, scenes.scene)
        # Any Start can be pickled, and testing 1e5 of them would take seconds.
        here = pickled_jobs(of_start, ()) is None
        return map(of_start, scenes.starts) if here else in_processes(of_start, scenes.starts)
    return in_processes(work, scenes, or_here=True)


def _of_start(work: Callable[[Scene], _Result], scene: Scene, start: Start) -> _Result:
    return work(scene.from_start(start))


def simulate_many(
    scene: Scene | str | Path | Sequence[Scene | str | Path],
    starts: Sequence[Start] | None = None,
    times: Times = None,
    *,
    settings: EngineSettings | str | None = None,
    engine: Engine | str = DEFAULT,
    device: str | None = None,
    progress: Progress | None = None,
) -> Iterator[ContactMotion]:
    """Simulate many starts of a scene, or many scenes, with a contact engine.

    Each motion equals the motion that `simulate` returns, to the last bit. Engines that can do so
    use all cores. Motions are computed as the iterator advances, so the memory used does not grow
    with the number of motions. With `device` the engine steps all balls together, and a motion
    differs from that of `simulate` by rounding.

    Parameters
    ----------
    scene : Scene, str, Path or sequence of these
        One scene, with many starts, or a sequence of scenes. The scenes of a sequence may also
        differ in their drives and bodies. A name or a file stands for its scene.
    starts : sequence of Start, optional
        The starts of a single scene.
    times : float or (n,), s, optional
        The duration, or sample times that increase from 0. The default is the times of the
        first scene.
    settings : EngineSettings or str, optional
        The engine's settings, or the name of a preset. The default is the engine's default preset.
    engine : Engine or str, default "mujoco"
        The engine, or its name.
    device : str, optional
        "cpu" or "cuda". It replaces the device in the settings, for engines that have a choice.
    progress : callable, optional
        Called with the fraction of the runs that are done, from 0 to 1.

    Returns
    -------
    iterator of ContactMotion
        The motions, in the order of the starts or of the scenes.

    Raises
    ------
    InputError
        If `starts` is given for a sequence of scenes, is missing for one scene, or has an item that
        is not a Start; if the engine has no choice of a device; or if `simulate` raises it. An
        invalid start raises InputError only when its motion is computed.

    Warns
    -----
    SceneWarning
        If settings are predicted to fail, or if a motion is implausible. If scenes differ only in
        their start, only the scenes with the smallest and the largest momentum are checked.

    Examples
    --------
    >>> from dataclasses import replace
    >>> import robotball as rb
    >>> scene = rb.load_scene("fig12")
    >>> starts = [replace(scene.start, momentum=f * scene.start.momentum) for f in (0.5, 1.0)]
    >>> for motion in rb.simulate_many(scene, starts, 1.0, settings="fast"):
    ...     print(f"{motion.path_length:.2f} m")
    1.87 m
    2.74 m
    """
    request = request_of(engine, settings)
    if device is not None:
        chosen: Any = request.settings
        if not hasattr(chosen, "device"):
            raise InputError(f"{request.engine.label.name} takes no device: leave the device out")
        _check_device(device)
        request = replace(request, settings=replace(chosen, device=device))
    one = isinstance(scene, Scene | str | Path)
    if one != (starts is not None):
        raise InputError("one scene needs starts, and several scenes take no starts")
    scenes: Sequence[Scene]
    if isinstance(scene, Scene | str | Path):
        scenes = FromStarts(scene_of(scene), starts or ())
    else:
        scenes = scene if isinstance(scene, FromStarts) else [*map(scene_of, scene)]
    sampled: Array | None = None
    for checked in scenes[:1] if isinstance(scenes, FromStarts) else scenes:
        sampled = runnable(checked, times if sampled is None else sampled, request)
    return iter(()) if sampled is None else _each(scenes, sampled, request, progress)


def _check_device(device: str) -> None:
    """Raise InputError for an unknown or missing device, before an engine spends seconds."""
    if device not in ("cpu", "cuda"):
        raise InputError(f"unknown device {device!r}: give cpu or cuda")
    if device == "cuda":
        try:
            ctypes.CDLL("libcuda.so.1")
        except OSError:
            raise InputError("device 'cuda' needs a CUDA driver: give cpu") from None


def _each(
    scenes: Sequence[Scene], times: Array, request: Request, progress: Progress | None
) -> Iterator[ContactMotion]:
    """Yield the motions of `simulate_many`."""
    assert request.settings is not None  # no accuracy is requested
    end = float(times[-1])
    whole: Sequence[Scene]
    if isinstance(scenes, FromStarts):
        whole = FromStarts(scenes.scene.until(end), scenes.starts)
    else:
        whole = [scene.until(end) for scene in scenes]
    motions = request.engine.run_many(whole, times, request.settings) if whole else ()
    for i, motion in zip(range(len(scenes)), motions, strict=True):
        yield as_of(scenes[i], motion)
        if progress is not None:
            progress((i + 1) / len(scenes))


def differ_in_start(scenes: Sequence[Scene]) -> bool:
    """Return whether scenes differ only in the start of the ball and its hinges."""
    if isinstance(scenes, FromStarts):
        return True
    first = scenes[0]
    angles = [hinge.angle for hinge in first.ball.hinges]
    rates = [hinge.rate for hinge in first.ball.hinges]

    def as_first(scene: Scene) -> Scene:
        if scene.ball is not first.ball and len(scene.hinges) == len(first.hinges):
            scene = scene.with_hinges(angle=angles, rate=rates)
        return scene.from_start(first.start)

    return all(as_first(scene) == first for scene in scenes)
