"""Motions made up from others, for what a test needs of them."""

from typing import Any

from robotball.engines.mujoco import LABEL
from robotball.motion import ContactMotion, ContactReport, Motion, extended


def as_contact(motion: Motion, report: ContactReport, **changes: Any) -> ContactMotion:
    """A motion as a contact engine would give it, with some fields changed."""
    return extended(motion, ContactMotion, **{"engine": LABEL, "report": report, **changes})


def known(error: float | None) -> float:
    """A measure of an agreement; infinite where the run broke off."""
    return float("inf") if error is None else error
