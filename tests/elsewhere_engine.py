"""An engine installed only in an environment: MuJoCo's mass matrix with our steps."""

from typing import Any

from robotball.engines.adapter import Adapter, World, by_name, version_of
from robotball.engines.pinocchio import PINOCCHIO
from robotball.motion import Label
from robotball.robot.scene import Scene
from tests.robotball.engines.test_adapters import Dynamics


def _world(scene: Scene, settings: Any, step: float) -> World:
    print("engines may print to standard output")
    return Dynamics(scene, settings, step)


ELSEWHERE = Adapter(
    label=Label("Elsewhere", version_of("only-there"), "#123456"),
    packages=("only_there",),
    extra="elsewhere",
    presets=by_name(PINOCCHIO.presets["RK4"]),
    default="RK4",
    world=_world,
    lacks=lambda scene, settings: "it warns",
)
