"""The table of a whole scene."""

from typing import Annotated

from robotball.described import key
from robotball.files.body_table import FrameTable, PendulumTable, RotorTable, ShellTable
from robotball.files.start_table import StartTable
from robotball.files.tables import Table
from robotball.parameters import Rolling
from robotball.parts import Triple
from robotball.scene import DOWN, GRAVITY


class FrictionTable(Table, frozen=True):
    """What the plane does to the shell besides carrying it."""

    sliding: Annotated[
        float | None, key("largest friction over the normal force; as much as needed if not given")
    ] = None
    torsional: Annotated[
        float | None,
        key("largest torque about the vertical over the normal force; likewise", "m"),
    ] = None
    rolling: Annotated[float, key("torque against rolling over the normal force", "m")] = 0.0


class NumbersTable(Table, frozen=True):
    """The numbers of the equations, for which bodies are designed."""

    radius: Annotated[float, key("a", "m")]
    A: Annotated[list[float | Triple], key("A: its diagonal, or three rows", "1/(kg m²)")]
    K: Annotated[Triple, key("K, in the same axes", "kg m²/s")]
    Omega: Annotated[Triple, key("Ω, in the same axes", "rad/s")]
    mass: Annotated[float | None, key("of the whole ball; found if not given", "kg")] = None


class SceneTable(Table, frozen=True):
    """What a scene is, as a whole."""

    title: Annotated[str, key("one line, for tables and plots")]
    rolling: Annotated[
        Rolling,
        key("`rubber`: the shell neither slips nor spins on the spot; `classical`: no slip"),
    ]
    duration: Annotated[float, key("of the motion", "s")]
    start: Annotated[StartTable, key("where the motion starts, see Start")]
    source: Annotated[str, key("where the numbers come from, any lines of text")] = ""
    gravity: Annotated[float, key("how fast things fall", "m/s²")] = GRAVITY
    gravity_direction: Annotated[
        Triple,
        key(
            "which way they fall, a direction of any length; Z is up from the plane, and "
            "`[tan(slope), 0, -1]` is a plane that goes down towards X"
        ),
    ] = DOWN
    friction: Annotated[FrictionTable, key("friction of the plane, see Friction")] = FrictionTable()
    shell: Annotated[ShellTable | None, key("the sphere that rolls, see Shell")] = None
    frame: Annotated[FrameTable | None, key("what turns in it, see Frame")] = None
    rotor: Annotated[tuple[RotorTable, ...], key("`[[rotor]]`, any number of them, see Rotor")] = ()
    pendulum: Annotated[
        tuple[PendulumTable, ...], key("`[[pendulum]]`, any number of them, see Pendulum")
    ] = ()
    numbers: Annotated[
        NumbersTable | None, key("instead of bodies: numbers of the paper's equations, see Numbers")
    ] = None
