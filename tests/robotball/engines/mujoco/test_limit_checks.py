"""Limits are checked before a run: each has its law, its number and the line that tells it."""

from dataclasses import replace

import numpy as np
import pytest

import robotball as rb
from robotball.engines.mujoco import limits as precheck
from robotball.engines.mujoco.limits import LimitCheck, exceeded, limit_checks
from robotball.engines.mujoco.settings import Prescribed, recipe
from tests.robotball.engines.mujoco.limits import FAST, FIG12
from validation import compare
from validation.studies.random_runs import random_scene


@pytest.mark.slow
def test_the_recipe_has_no_limit_near() -> None:
    """The presets but naive are inside on every scene of the catalog and on a hundred random balls.

    But for one: the catalog's servos are too strong for steps of 20 ms.
    """
    scenes = [rb.load_scene(name) for name in rb.catalog()] + [random_scene(i) for i in range(100)]
    beyond = [
        (scene.name, settings.name)
        for scene in scenes
        for settings in rb.PRESETS.values()
        if settings.name != "naive" and exceeded(scene, settings, scene.times)
    ]
    assert beyond == [("servo_motors", "fast")]


def test_the_naive_preset_is_beyond_several() -> None:
    """What a newcomer writes is warned of on fig12 before a step is taken."""
    naive = exceeded(FIG12, rb.preset("naive"), FIG12.times)
    assert [limit.what for limit in naive] == [
        "the part of M that Euler may lose or gain",
        "torsional friction",
        "the share of its rate that a servo loses under its load",
    ]
    assert str(naive[1]) == (
        "torsional friction is 0.005 m and must be at least 1.766 m: "
        "the ball spins on the spot; give torsional_friction more"
    )
    assert str(naive[2]) == (
        "the share of its rate that a servo loses under its load is 0.5142 and must be at most "
        "0.01: take a higher gain, or prescribe the rate"
    )


def test_every_limit_has_its_law_and_its_derivation() -> None:
    """Each prediction has a law for a legend, and says in its docstring where it comes from."""
    laws = {predict.__name__: law for predict, law in precheck.LAWS.items()}
    assert len(laws) == 21
    assert all(len(law) < 75 for law in laws.values())
    for predict in precheck.LAWS:
        assert predict.__doc__
        assert len(predict.__doc__) > 60


def test_a_warning_names_the_number_the_limit_and_the_fix() -> None:
    """One line, also for Python's warnings; strict makes it an error."""
    times = np.linspace(0.0, 0.1, 3)
    slippery = replace(FAST, sliding_friction=0.1)
    words = (
        r"fig12, fast: sliding friction is 0\.1 and must be at least 0\.4547: "
        r"the ball slips; give sliding_friction more$"
    )
    with pytest.warns(rb.SceneWarning, match=words):
        rb.simulate(FIG12, times, slippery)
    for work in (rb.simulate, compare):
        with pytest.raises(rb.InputError, match="must be at least"):
            work(FIG12, times=times, settings=slippery, strict=True)


def test_an_edge_knows_how_near_it_is() -> None:
    """Limits from above and from below, none at all and numbers that are none."""
    assert LimitCheck("", 2.0, 4.0, "").nearness == 0.5
    assert LimitCheck("", 2.0, 4.0, "", least=True).nearness == 2.0
    assert LimitCheck("", 0.0, 0.0, "").nearness == 0.0
    assert not LimitCheck("", 4.0, 4.0, "", least=True).exceeded
    assert LimitCheck("", np.nan, 1.0, "").exceeded


def test_every_scene_has_all_its_edges_as_numbers() -> None:
    """No prediction fails on a recipe with servos or on a huge armature."""
    for settings in (rb.preset("naive"), recipe("x", 1e-2), replace(FAST, drive=Prescribed(1.0))):
        for name in rb.catalog():
            scene = rb.load_scene(name)
            assert all(limit.nearness >= 0 for limit in limit_checks(scene, settings, scene.times))
