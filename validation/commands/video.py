"""The command `robotball video`."""

from dataclasses import dataclass, field

from validation.commands.arguments import (
    AGREES,
    DISAGREES,
    Preset,
    Run,
    RunOptions,
    SceneName,
    Threads,
    times_of,
)


@dataclass(frozen=True)
class Video:
    """Film a scene: the ball of an engine beside the ball of the equations, as an mp4.

    Example: robotball video fig12 --duration 2
    """

    scene: SceneName
    """A name from the catalog, or a path to a TOML file."""
    preset: Preset = None
    """The engine's settings to run it with, its default if not given."""
    run_options: RunOptions = field(default_factory=Run)
    threads: Threads = None

    def run(self) -> int:
        from robotball import load_scene
        from validation.comparison.names import file_stem
        from validation.comparison.runs import agreements_of, film, tell_fault_windows, windows
        from validation.output import writable_folder
        from validation.progress import progress_bar

        options, scene = self.run_options, load_scene(self.scene)
        request, out = options.request(self.preset), writable_folder(options.out)
        times = times_of(options.duration)
        with progress_bar(1) as show:
            agreements = agreements_of(
                scene, [request], times, strict=options.strict, fault_windows=out, show=show
            )
        (agreement,) = agreements
        tell_fault_windows(windows(agreements, out))
        path = out / f"{file_stem(agreements)}.mp4"
        film(path, agreement)
        print(path)
        return AGREES if agreement.agrees else DISAGREES
