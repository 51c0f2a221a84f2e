"""Split an engine's distance from ideal rolling into an effect of friction and an error."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from robotball import Engine, InputError, Motion, integrate
from robotball.errors import percent
from robotball.motion import ContactMotion, ReferenceMotion, path_error
from robotball.robot.scene import Friction, Scene

from .output import known

_SHOWN = 3  # intervals of slip in a text
_STEPS = 2000  # 1/s, most steps of another motion; fig12 takes 180


@dataclass(frozen=True)
class Slip:
    """A motion whose friction is less than ideal rolling needs.

    Attributes
    ----------
    sliding, torsional : float or None, - and m
        The coefficients of the contact. None if friction is unlimited.
    needed_sliding, needed_torsional : float or None, - and m
        The coefficients that ideal rolling needs. None if the ball cannot roll ideally.
    intervals : sequence of (float, float), s
        The intervals in which a ball with this friction slips, computed with the equations.
    by_friction : float or None
        The path error of the ball with this friction against ideal rolling.
    by_engine : float or None
        The engine's path error against the ball with this friction. None if the run failed.
    of_settings : bool
        True if the friction is given by the engine's settings, False if the scene gives it.
    other : ReferenceMotion or None
        The equations' second motion: with this friction if `of_settings`, otherwise ideal rolling.
    """

    sliding: float | None
    torsional: float | None
    needed_sliding: float | None
    needed_torsional: float | None
    intervals: Sequence[tuple[float, float]]
    by_friction: float | None
    by_engine: float | None
    of_settings: bool
    other: ReferenceMotion | None

    def __str__(self) -> str:
        has, need = [], []
        pairs = (
            ("sliding friction", "", self.sliding, self.needed_sliding),
            ("torsional friction", " m", self.torsional, self.needed_torsional),
        )
        for kind, unit, own, needed in pairs:
            if own is not None:
                has.append(f"{kind} is {own:.3g}{unit}")
                need.append("" if needed is None else f"{needed:.3g}{unit}")
        parts = [" and ".join(has)]
        if all(need):
            parts[0] += f", and rolling without slip needs {' and '.join(need)}"
        parts.append(f"such a ball slips from {listed(self.intervals)}")
        return "; ".join(filter(None, [*parts, self.split]))

    @property
    def split(self) -> str:
        """The parts of friction and engine as words, as far as they are known."""
        parts = []
        if self.by_friction is not None:
            parts.append(f"friction alone changes the path by {percent(self.by_friction)}")
        # If the scene gives the friction, the engine's part is the path error of the table.
        if self.of_settings and self.by_engine is not None:
            parts.append(f"the engine is {percent(self.by_engine)} off the path with this friction")
        return "; ".join(parts)


def others(agreements: Sequence[Any]) -> list[ReferenceMotion]:
    """Return the motion that differs from the reference in friction alone, for a single run."""
    slip = agreements[0].slip if len(agreements) == 1 else None
    return [slip.other] if slip and slip.other else []


def listed(intervals: Sequence[tuple[float, float]]) -> str:
    """Return the first intervals of slip [s] as words, and the number of further intervals."""
    shown = [f"{begin:.3g} to {end:.3g} s" for begin, end in intervals[:_SHOWN]]
    more = len(intervals) - len(shown)
    return ", ".join(shown) + (f" and {more} times more" if more else "")


def slip_of(theory: Motion, motion: ContactMotion, engine: Engine | None) -> Slip | None:
    """Return the slip of a comparison; None if the friction suffices, or is not known.

    The friction is taken from the scene, or else from the engine's settings.
    """
    scene = theory.scene
    if not isinstance(theory, ReferenceMotion) or scene.controller is not None:
        return None
    if theory.slip is not None:
        return _slip(scene.friction, _integrated(scene.ideal, theory), theory, motion, False)
    friction = engine.friction(scene, motion.report.settings) if engine else None
    if friction is None:
        return None
    limits = replace(scene.friction, sliding=friction.sliding, torsional=friction.torsional)
    limited = replace(scene, friction=limits)
    if theory.loads.grip(limited.slip_limits).max() <= 1:
        return None
    slipping = _integrated(limited, theory)
    if slipping is None or slipping.slip is None:
        return None
    return _slip(limits, theory, slipping, motion, True)


def _integrated(scene: Scene, like: Motion) -> ReferenceMotion | None:
    """Return a scene's motion at the times of another; None if it fails or has too many steps."""
    try:
        most = int(_STEPS * max(1.0, like.times[-1]))
        return integrate(scene, like.times, max_steps=most)
    except InputError:
        return None


def _slip(
    friction: Friction,
    ideal: ReferenceMotion | None,
    slipping: ReferenceMotion,
    motion: ContactMotion,
    of_settings: bool,
) -> Slip:
    """Return the slip of an ideal motion, the motion with friction, and an engine's motion."""
    whole = len(motion.times) == len(slipping.times)
    rubber = slipping.scene.rolling == "rubber"
    return Slip(
        sliding=friction.sliding,
        torsional=friction.torsional if rubber else None,
        needed_sliding=None if ideal is None else float(ideal.loads.sliding_friction.max()),
        needed_torsional=None if ideal is None else float(ideal.loads.torsional_friction.max()),
        intervals=slipping.slipping,
        by_friction=None if ideal is None else path_error(slipping, ideal),
        by_engine=known(path_error(motion, slipping)) if whole else None,
        of_settings=of_settings,
        other=slipping if of_settings else ideal,
    )
