"""The command `robotball lyapunov`."""

from dataclasses import dataclass

from validation.commands.arguments import AGREES, File, Preset, SceneName, Threads

BATCH = 16  # starts a core followed at once, between two moves of the progress bar


@dataclass(frozen=True)
class Lyapunov:
    """Measure a scene's Lyapunov exponents, by the equations and, on request, by an engine.

    Example: robotball lyapunov fig14 --starts 4 --duration 1000
    """

    scene: SceneName
    """A name from the catalog, or a path to a TOML file."""
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
        import numpy as np
        from rich import box
        from rich.console import Console
        from rich.table import Table

        from robotball import preset
        from robotball.cores import allowed
        from robotball.engines.mujoco import LABEL
        from robotball.engines.mujoco.model import build
        from robotball.qualitative.long_run import Exponents, exponents
        from validation.commands.suited import moving_scene
        from validation.output import print_whole, progress_bar, write_record
        from validation.studies.attractors import contact_exponent
        from validation.studies.contact_sections import level_starts

        scene = moving_scene(self.scene, "an exponent")
        settings = None if self.preset is None else preset(self.preset)
        attitudes, momenta = level_starts(scene, self.starts, self.seed)
        record: dict[str, object] = {"scene": scene.name, "starts": self.starts, "seed": self.seed}
        with progress_bar(self.starts * (1 if settings is None else 2)) as show:
            parts, together = [], BATCH * allowed()
            for i in range(0, self.starts, together):
                show(i, f"{scene.name}: equations")
                batch = slice(i, i + together)
                parts.append(
                    exponents(
                        scene.parameters,
                        attitudes[batch],
                        momenta[batch],
                        self.duration,
                        self.transient,
                    )
                )
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
                contact = contact_exponent(
                    build(scene, settings),
                    attitudes,
                    momenta,
                    self.duration / 10,
                    min(100.0, self.transient),
                    interval=10.0,
                    progress=lambda part: show(
                        self.starts * (1 + part), f"{scene.name}: {LABEL.name}"
                    ),
                )
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
