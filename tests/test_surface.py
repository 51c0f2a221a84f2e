"""The public functions take scenes, paths, times and settings in the same forms."""

import inspect
import re
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import robotball as rb
from tests.imports import PUBLIC
from tests.messages import naming

FUNCTIONS = {
    name: value
    for home, name in PUBLIC
    for value in [getattr(import_module(home), name)]
    if inspect.isfunction(value)
}
SCENE = rb.load_scene("fig12")
KEYWORDS = ("settings", "engine", "accuracy", "strict", "progress", "device", "theory")


@pytest.mark.parametrize("name", FUNCTIONS)
def test_public_functions_have_consistent_parameters(name: str) -> None:
    """A scene or a path may be a str; options are keyword-only."""
    for key, parameter in inspect.signature(FUNCTIONS[name]).parameters.items():
        annotation = str(parameter.annotation)
        if key == "scene" or "Path" in annotation:
            assert {"str", "Path"} <= {*re.findall(r"\w+", annotation)}
        if key in KEYWORDS:
            assert parameter.kind is inspect.Parameter.KEYWORD_ONLY, key


@pytest.mark.parametrize("times", [0.5, 1, np.float32(0.5), [0.0, 0.1, 0.2], (0, 1)])
def test_times_are_a_duration_or_an_array(times: Any) -> None:
    """A duration of 0.5 s gives the sample times from 0 to 0.5 s."""
    expected = rb.sample_times(float(times)) if np.ndim(times) == 0 else np.array(times, float)
    assert (rb.integrate(SCENE, times).times == expected).all()
    (motion,) = rb.simulate_many(SCENE, [SCENE.start], times, settings="fast")
    for run in (rb.simulate(SCENE, times, settings="fast"), motion):
        assert (run.times == expected).all()
    assert (rb.compare(SCENE, times, settings="fast").theory.times == expected).all()


def test_a_preset_in_place_of_times_is_refused_with_the_keyword() -> None:
    with pytest.raises(rb.InputError, match=naming("times 'fast' settings='fast'")):
        rb.compare("fig12", "fast")
    with pytest.raises(TypeError):
        rb.simulate("fig12", 1.0, "fast")  # type: ignore[call-arg]


def test_every_function_takes_a_scene_as_a_name_or_a_path(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With the same result as for the loaded scene; each refuses an unknown name."""
    monkeypatch.chdir(tmp_path)
    text = rb.scene_toml("fig12")
    Path("fig12.toml").write_text(text)
    rb.integrate("fig12", 0.5).save("run.csv")
    trajectory = rb.read_trajectory("run.csv")
    for scene in ("fig12.toml", Path("fig12.toml"), tmp_path / "fig12.toml", SCENE):
        assert rb.scene_toml(scene) == text
        assert rb.load_motion("run.csv", scene) == rb.load_motion(Path("run.csv"), SCENE)
        assert rb.recorded(scene, trajectory) == rb.recorded(SCENE, trajectory)
        assert rb.read_log("run.csv", scene).end == 0.5
        files = rb.export_scene(scene, "out", 0.1)
        assert Path("out/scene.toml").read_text() == text
        assert Path("out/README.md") in files
    for call in (
        rb.scene_toml,
        rb.integrate,
        rb.simulate,
        rb.compare,
        lambda scene: rb.export_scene(scene, "out"),
        lambda scene: rb.load_motion("run.csv", scene),
        lambda scene: rb.recorded(scene, trajectory),
        lambda scene: rb.read_log("run.csv", scene),
        lambda scene: rb.simulate_many(scene, [SCENE.start]),
        lambda scene: [*rb.simulate_many([scene])],
        lambda scene: rb.compare_many(scene, [SCENE.start]),
        lambda scene: rb.fit(scene, "run.csv", ["frame.mass"]),
    ):
        with pytest.raises(rb.InputError, match=naming("scene 'fig21' fig12")):
            call("fig21")


def arrays_in(value: Any, name: str) -> Iterator[tuple[str, np.ndarray[Any, Any]]]:
    """Yield the arrays of a record and of the records, tuples and mappings in it."""
    if isinstance(value, np.ndarray):
        yield name, value
    elif is_dataclass(value):
        for field in fields(value):
            yield from arrays_in(getattr(value, field.name), f"{name}.{field.name}")
    elif isinstance(value, list | tuple):
        for i, item in enumerate(value):
            yield from arrays_in(item, f"{name}[{i}]")
    elif isinstance(value, Mapping):
        for key, item in value.items():
            yield from arrays_in(item, f"{name}[{key}]")


def test_arrays_of_public_records_are_read_only(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Records are checked when they are created; arrays of the user are copied."""
    monkeypatch.chdir(tmp_path)
    times = np.linspace(0.0, 0.5, 26)
    theory = rb.integrate("pendulum_robot", times)
    theory.save("run.csv")
    records = {
        "scene": theory.scene,
        "theory": theory,
        "motion": rb.simulate("pendulum_robot", times),
        "trajectory": rb.read_trajectory("run.csv"),
        "recorded": rb.recorded("pendulum_robot", rb.read_trajectory("run.csv")),
        "log": rb.read_log("run.csv", "pendulum_robot"),
        "section": rb.section("fig12", 3),
        "exponents": rb.exponents("fig12", 20.0, transient=10.0),
        "equilibria": rb.equilibria("fig06"),
        "agreement": rb.compare("fig12", 0.1),
    }
    arrays = [item for name, record in records.items() for item in arrays_in(record, name)]
    assert len(arrays) > 100
    assert [name for name, array in arrays if array.flags.writeable] == []
    times[:] = 0.0
    assert theory.times[-1] == 0.5


def test_simulate_many_takes_names_of_scenes() -> None:
    one, other = rb.simulate_many(["fig12", "fig14"], None, 0.1, settings="fast")
    assert (one.scene.name, other.scene.name) == ("fig12", "fig14")
