"""Motions made up from others, for what a test needs of them."""

from dataclasses import fields
from typing import Any

from robotball.engines.mujoco import LABEL
from robotball.motion import ContactMotion, ContactReport, Motion


def as_contact(motion: Motion, report: ContactReport, **changes: Any) -> ContactMotion:
    """A motion as a contact engine would give it, with some fields changed."""
    given = {field.name: getattr(motion, field.name) for field in fields(Motion)}
    return ContactMotion(**{**given, "engine": LABEL, "report": report, **changes})


def known(error: float | None) -> float:
    """A measure of an agreement; infinite where the run broke off."""
    return float("inf") if error is None else error
