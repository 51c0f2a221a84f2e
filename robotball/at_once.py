"""Many motions at once, by a contact engine: from many starts, or of many scenes."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

from robotball.engine import DEFAULT, Engine, Request, as_of, request_of, runnable
from robotball.engines import Progress
from robotball.errors import InputError
from robotball.motion import ContactMotion, EngineSettings
from robotball.rotations import Array
from robotball.scene import Scene, Start


def simulate_many(
    scene: Scene | Sequence[Scene],
    starts: Sequence[Start] | None = None,
    times: Array | None = None,
    settings: EngineSettings | str | None = None,
    *,
    engine: Engine | str = DEFAULT,
    device: str | None = None,
    progress: Progress | None = None,
) -> Iterator[ContactMotion]:
    """Return an iterator of the motions of a scene's ball from many starts, in their order.

    Or of several scenes, which may differ in drives and bodies too, at the same times: without
    `starts`. Each is the motion that `simulate` returns of that scene, to the last bit; times (the
    first scene's own if None), settings and engine are as there. An engine that can works on all
    cores, and holds the rows of some of the runs at a time: whoever keeps no motion needs no memory
    for it. device: "cpu" or "cuda", in place of the settings', where an engine with a choice steps
    all balls abreast, which are then equal to rounding. progress is called with the part of the
    runs that is done. Warns of settings that are predicted to fail, of many starts from those with
    the least and the most momentum, and of each motion that can hardly be what was meant. Raises
    InputError as `simulate` does.
    """
    request = request_of(engine, settings)
    if device is not None:
        own: Any = request.settings
        if not hasattr(own, "device"):
            raise InputError(f"{request.engine.label.name} has no choice of a device: leave it out")
        request = replace(request, settings=replace(own, device=device))
    if (starts is None) == isinstance(scene, Scene):
        raise InputError("give starts with one scene, and none with several")
    if isinstance(scene, Scene):
        scene = [replace(scene, start=each) for each in starts or ()]
    for each in scene:
        times = runnable(each, times, request)
    return iter(()) if times is None else _each(scene, times, request, progress)


def _each(
    scenes: Sequence[Scene], times: Array, request: Request, progress: Progress | None
) -> Iterator[ContactMotion]:
    """Yield the motions of `simulate_many`."""
    assert request.settings is not None  # as no accuracy is requested
    whole = [each.until(float(times[-1])) for each in scenes]
    motions = request.engine.run_many(whole, times, request.settings) if whole else ()
    for done, (scene, motion) in enumerate(zip(scenes, motions, strict=True), start=1):
        yield as_of(scene, motion)
        if progress is not None:
            progress(done / len(scenes))


def differ_in_start(scenes: Sequence[Scene]) -> bool:
    """Return whether scenes differ in nothing but how the ball and its hinges start."""
    first = scenes[0]
    angles = [each.angle for each in first.ball.hinges]
    rates = [each.rate for each in first.ball.hinges]

    def as_first(scene: Scene) -> Scene:
        if scene.ball is not first.ball and len(scene.hinges) == len(first.hinges):
            scene = scene.with_hinges(angle=angles, rate=rates)
        return replace(scene, start=first.start)

    return all(as_first(each) == first for each in scenes)
