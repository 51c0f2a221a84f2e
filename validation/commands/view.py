"""The command `robotball view`."""

from dataclasses import dataclass, field

from validation.options import (
    AGREES,
    DISAGREES,
    Preset,
    Run,
    RunOptions,
    SceneName,
    times_of,
)


@dataclass(frozen=True)
class View:
    """Watch both balls roll in step, that of the equations as a ghost, in a window or a page.

    Example: robotball view fig12 --web
    """

    scene: SceneName
    """A name from the catalog, or a path to a TOML file."""
    preset: Preset = None
    """The engine's settings to run it with, its default if not given."""
    web: bool = False
    """Write a page for any browser, which needs no network, in place of a window."""
    run_options: RunOptions = field(default_factory=Run)

    def run(self) -> int:
        import sys

        from robotball import load_scene
        from robotball.film.viewer import KEYS, check_display, view
        from robotball.film.web import view_page
        from validation.output import progress_bar, writable_folder, write_text
        from validation.results import file_stem
        from validation.runs import agreements_of, tell_fault_windows, windows

        options, scene = self.run_options, load_scene(self.scene)
        request, out = options.request(self.preset), writable_folder(options.out)
        if not self.web:
            check_display()
        with progress_bar(1) as show:
            agreements = agreements_of(
                scene,
                [request],
                times_of(options.duration),
                strict=options.strict,
                fault_windows=out,
                show=show,
            )
        (agreement,) = agreements
        tell_fault_windows(windows(agreements, out))
        if self.web:
            path = out / f"{file_stem(agreements)}-view.html"
            write_text(path, view_page([agreement.motion, agreement.theory]))
            print(path)
        else:
            print(KEYS, file=sys.stderr)
            view(agreement.motion, agreement.theory)
        return AGREES if agreement.agrees else DISAGREES
