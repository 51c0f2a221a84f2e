"""Robot files in the style of different users, with the expected answers of `check`."""

from collections.abc import Mapping
from typing import NamedTuple

# A ball that rolls correctly, with fields for the changes of each case.
_BALL = """<mujoco>{top}<option timestep=".001" integrator="RK4" cone="elliptic"/><worldbody>
{floor}{world}<body name="ball" pos="{at}">{free}
<geom name="shell" type="sphere" size="{radius}" mass="{mass}" {solid}/>{shell}
<body name="plate"><joint name="axle" axis="0 1 0" damping=".01" {axle}/>
<geom name="bob" type="box" size=".06 .05 .004" pos="0 0 -.05" mass=".8" {bob}/>{plate}
</body></body></worldbody><contact>{contact}{pair}</contact>{tendon}
<actuator>{drive}</actuator>{key}</mujoco>"""
_USUAL = {
    "top": "", "world": "", "at": "0 0 .15", "free": "<freejoint/>", "radius": ".15", "mass": ".6",
    "solid": "", "shell": "", "axle": "", "plate": "", "contact": "", "tendon": "",
    "bob": 'contype="0" conaffinity="0"',
    "floor": '<geom name="floor" type="plane" size="5 5 .1"/>',
    "pair": '<pair geom1="floor" geom2="shell" condim="3" friction="20 20 .005 .0001 .0001" '
            'solref=".004 1" solimp=".9999 .9999 .001 .5 1"/>',
    "drive": '<motor name="drive" joint="axle"/>',
    "key": '<keyframe><key ctrl=".1"/></keyframe>',
}  # fmt: skip
_GHOST = 'contype="0" conaffinity="0"'
_NO_PAIR = {"pair": ""}
_HARD = 'friction="20 .005 .0001" solref=".004 1" solimp=".9999 .9999 .001 .5 1"'
_PUSHED = {"drive": "", "key": ""}  # a robot without motors is pushed
_ROLLING = '<keyframe><key qpos="0 0 .15 1 0 0 0 0" qvel=".3 0 0 0 2 0 -2" ctrl="0"/></keyframe>'


class Case(NamedTuple):
    """Changes to the file, expected exit status, and words of the answer."""

    edits: Mapping[str, str]
    status: int
    words: str
    options: tuple[str, ...] = ()

    @property
    def text(self) -> str:
        """The file."""
        return self.edits.get("file") or _BALL.format(**{**_USUAL, **self.edits})


def _fixed(kind: str, size: str, pos: str, more: str = "") -> str:
    return f'<geom name="thing" type="{kind}" size="{size}" pos="{pos}" {more}/>'


def _wheel(pos: str, size: str, more: str = "") -> str:
    """Return a wheel on a hinge, about the axis Y."""
    return (
        f'<body name="wheel" pos="{pos}"><joint name="hub" axis="0 1 0"/><geom name="tyre" '
        f'type="cylinder" size="{size}" euler="90 0 0" mass=".05" {more}/></body>'
    )


_MESH = (
    '<asset><mesh name="hull" vertex="{0} 0 0 -{0} 0 0 0 {0} 0 0 -{0} 0 0 0 {0} 0 0 -{0}"/></asset>'
)
_PENDULUM = (
    '<body name="arm" pos="0 0 -.02"><joint name="tilt" axis="1 0 0" {joint}/><geom name="weight" '
    'type="sphere" size=".01" pos="0 0 -.04" mass=".3" {geom}/></body>'
)
_LINK = (
    '<inertial><mass value="{}"/><origin xyz="{}"/><inertia ixx=".004" iyy=".004" izz=".004" '
    'ixy="0" ixz="0" iyz="0"/></inertial>'
)
_URDF = (
    f'<robot name="u"><link name="hull">{_LINK.format(".6", "0 0 0")}<collision><geometry>'
    f'<sphere radius=".15"/></geometry></collision></link><link name="bob">'
    f'{_LINK.format(".8", "0 0 -.05")}</link><joint name="axle" type="{{}}"><parent link="hull"/>'
    '<child link="bob"/><axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="1" velocity="9"/>'
    "</joint></robot>"
)

# The root is the inner link, and can touch something.
_SOLID_BASE = (
    _URDF.format("continuous")
    .replace('"hull"/><child link="bob"', '"bob"/><child link="hull"')
    .replace(
        "</link><j", '<collision><geometry><sphere radius=".02"/></geometry></collision></link><j'
    )
)

RIGHT, OFF, REFUSED = 0, 1, 2
CASES = {
    # floors
    "plane": Case({}, RIGHT, ""),
    "plane in a static body": Case(
        {"floor": f'<body name="ground">{_USUAL["floor"]}</body>'}, RIGHT, ""
    ),
    "plane in a moved body": Case(
        {"floor": f'<body name="ground" mocap="true">{_USUAL["floor"]}</body>', "key": ""}, RIGHT,
        "robot.xml No control given"),
    "raised plane": Case(
        {"floor": '<body pos="0 0 .3"><geom name="floor" type="plane" size="5 5 .1"/></body>',
         "at": "0 0 .45"}, RIGHT, ""),
    "tilted plane": Case(
        {"floor": '<body euler="0 2 0"><geom name="floor" type="plane" size="5 5 .1"/></body>',
         "at": ".00523492 0 .149908624", **_PUSHED}, RIGHT, ""),
    "a drawn plane too": Case(
        {"world": f'<geom type="plane" size="1 1 .1" pos="0 0 -.01" {_GHOST}/>'}, RIGHT, ""),
    "a plane far below": Case({"world": '<geom type="plane" size="1 1 .1" pos="0 0 -1"/>'}, RIGHT,
                              ""),
    "box as floor": Case({"floor": _fixed("box", "5 5 .1", "0 0 -.1"), **_NO_PAIR}, RIGHT, ""),
    "tilted box as floor": Case(
        {"floor": _fixed("box", "5 5 .1", "0 0 -.1", 'euler="5 0 0"'), **_NO_PAIR}, RIGHT, ""),
    "box on hinges as floor": Case(
        {"floor": '<body pos="0 0 -.1"><joint name="roll" axis="1 0 0"/>'
                  '<geom name="tray" type="box" size="1 1 .1" mass="9"/></body>', **_NO_PAIR},
        REFUSED, "tray is a box that moves"),
    "mesh as floor": Case(
        {"top": _MESH.format("2"), **_NO_PAIR,
         "floor": '<geom name="hills" type="mesh" mesh="hull" pos="0 0 -2"/>'}, REFUSED,
        "hills is a mesh"),
    "height field as floor": Case(
        {"top": '<asset><hfield name="h" nrow="3" ncol="3" size="2 2 .1 .1"/></asset>',
         "floor": '<geom name="terrain" type="hfield" hfield="h"/>', **_NO_PAIR}, REFUSED,
        "terrain is a hfield"),
    "cylinder as floor": Case({"floor": _fixed("cylinder", "5 .1", "0 0 -.1"), **_NO_PAIR}, REFUSED,
                              "thing is a cylinder"),
    "no floor": Case({"floor": "", "pair": "", "solid": _HARD}, OFF,
                     "cause: floor: there is no floor"),
    "plane that excludes the sphere": Case(
        {"floor": f'<geom name="floor" type="plane" size="5 5 .1" {_GHOST}/>', **_NO_PAIR}, REFUSED,
        "passes through the plane"),
    # obstacles
    "wall": Case({"world": _fixed("box", ".01 1 .5", ".24 0 .5"), "key":
                  _ROLLING},
                 OFF, "shell touches thing at t = 0.2"),
    "wall as a plane": Case(
        {"world": '<geom name="thing" type="plane" size="1 1 .1" pos=".23 0 0" zaxis="-1 0 0"/>',
         "key": _ROLLING},
        OFF, "shell touches thing at t = 0.2"),
    "wall far away": Case({"world": _fixed("box", ".01 1 .5", "4 0 .5")}, RIGHT, "leave out thing"),
    "wall at the start": Case({"world": _fixed("box", ".01 1 .5", ".155 0 .5")}, REFUSED,
                              "shell touches thing"),
    "ledge": Case({"world": _fixed("box", ".3 .3 .1", "0 0 .1"), "at": "0 0 .35"}, REFUSED,
                  "shell touches thing"),
    "thin ledge": Case({"world": _fixed("box", ".3 .3 .01", "0 0 .6"), "at": "0 0 .77"}, REFUSED,
                       "shell touches thing"),
    "drawn wall": Case({"world": _fixed("box", ".01 1 .5", ".1 0 .5", _GHOST)}, RIGHT, ""),
    "wall that the pair leaves out": Case(
        {"world": _fixed("box", ".01 1 .5", ".1 0 .5", 'contype="2" conaffinity="2"')}, RIGHT, ""),
    # wheels
    "wheel inside, on the plate": Case({"plate": _wheel("0 0 -.118", ".03 .01")}, REFUSED,
                                       "shell touches tyre"),
    "cart inside": Case(
        {"world": '<body name="cart" pos="0 0 .05"><freejoint/><geom name="cart" size=".03" '
                  'mass=".2"/></body>'}, REFUSED, "shell touches cart"),
    "trailing wheel": Case({"plate": _wheel("-.3 0 -.11", ".04 .01")}, REFUSED,
                           "tyre touches floor"),
    "trailing wheel, a little above": Case({"plate": _wheel("-.3 0 -.109", ".04 .01")}, REFUSED,
                                           "tyre touches floor at t ="),
    "flywheel that fills the shell": Case(
        {"plate": '<body name="fly"><joint name="spin" axis="0 0 1"/><geom name="disc" '
                  'type="cylinder" size=".14 .01" mass=".2"/></body>'}, OFF, "contacts: "),
    "a solid part on the shell": Case({"bob": ""}, RIGHT, ""),  # parent and child never touch
    "solid parts inside": Case(
        {"bob": "", "plate": _PENDULUM.format(joint='damping=".02"', geom="")}, OFF, "contacts: "),
    "body beside, far": Case(
        {"world": '<body name="crate" pos="2 0 .1"><freejoint/><geom name="crate" type="box" '
                  'size=".1 .1 .1" mass="1"/></body>'}, RIGHT, "crate is not part of the robot"),
    "body in its way": Case(
        {"world": '<body pos=".34 0 .1"><freejoint/><geom name="crate" type="box" size=".1 .1 .1" '
                  'mass="1"/></body>', "key": '<keyframe><key qpos=".34 0 .1 1 0 0 0 0 0 .15 1 0 '
                  '0 0 0" qvel="0 0 0 0 0 0 .3 0 0 0 2 0 -2"/></keyframe>'}, OFF,
        "ends early: shell touches crate"),
    "part that sticks out below": Case({"bob": "", "shell":
        '<geom name="foot" type="box" size=".02 .02 .02" pos="0 0 -.15" mass=".01"/>'}, REFUSED,
        "foot touches floor"),
    "mesh shell around the sphere": Case(
        {"top": _MESH.format(".15"), "shell": '<geom name="hull" type="mesh" mesh="hull" '
         'mass=".01"/>'}, RIGHT, ""),
    "drawn mesh shell": Case(
        {"top": _MESH.format(".15"), "shell": '<geom name="hull" type="mesh" mesh="hull" mass="0" '
         f'{_GHOST}/>'}, RIGHT, ""),
    "mesh shell alone": Case(
        {"top": _MESH.format(".15"), "shell": '<geom name="hull" type="mesh" mesh="hull"/>',
         "solid": _GHOST, **_NO_PAIR}, REFUSED, "no sphere can touch the plane"),
    # stops
    "stop far away": Case({"axle": 'range="-170 170"'}, RIGHT, ""),
    "stop that is reached": Case({"axle": 'range="-.2 .2"'}, OFF, "axle reaches its range"),
    "stop at the start": Case({"axle": 'range="-60 0"'}, REFUSED, "axle starts at an end"),
    "stop that it leaves": Case({"axle": 'range="0 170"'}, RIGHT, ""),
    "starts outside its stops": Case({"axle": 'range="5 60"'}, REFUSED, "outside its range"),
    "radians in degrees": Case({"axle": 'range="-.0157 .0157"'}, REFUSED, "axle reaches its range"),
    "stop of geoms": Case(
        {"plate": _PENDULUM.format(joint="", geom=""), "solid": 'contype="2" conaffinity="2"',
         "shell": '<geom name="pin" type="box" size=".01 .01 .01" pos="0 .034 -.06" mass=".01"/>',
         "key": '<keyframe><key qvel=".3 0 0 0 2 0 -2 7" ctrl="0"/></keyframe>'}, OFF,
        "touches"),
    # units
    "millimetres": Case({"radius": "150", "at": "0 0 150"}, REFUSED,
                    "1.5 (150 cm) or 0.15 (150 mm)?"),
    "millimetres as given": Case({"radius": "150", "at": "0 0 150"}, OFF, "stands still",
                                 ("--as-given",)),
    "grams": Case({"mass": "600"}, REFUSED, "did you mean 0.6 (600 g)?"),
    "degrees": Case({"key": '<keyframe><key qpos="0 0 .15 1 0 0 0 30" ctrl=".1"/></keyframe>'},
                    REFUSED, "did you mean 0.5236 (30 °)?"),
    "gravity in millimetres": Case({"top": '<option gravity="0 0 -9810"/>'}, REFUSED,
                                   "did you mean 9.81 (9810 mm/s²)?"),
    # what MuJoCo rolls as well
    "predefined pair alone": Case({"solid": _GHOST}, RIGHT, ""),
    # joints and what drives them
    "slide in place of a free joint": Case(
        {"free": '<joint type="slide" axis="1 0 0"/><joint name="r" axis="0 1 0"/>'}, REFUSED,
        "in place of joint 0, r"),
    "no joint at all": Case({"free": "", **_PUSHED}, OFF, "cause: freejoint: ball has no joint"),
    "no joint, and positions in the keyframe": Case(
        {"free": "", "key": '<keyframe><key qpos=".1" qvel=".2" ctrl=".1"/></keyframe>'}, OFF,
        "mended: path error"),
    "free joint by its long name": Case({"free": '<joint type="free"/>'}, RIGHT, ""),
    "damped free joint": Case({"free": '<joint type="free" damping=".1"/>'}, OFF,
                              "cause: freejoint: damping 0.1 acts on the free joint of ball"),
    "free joint with a default class": Case(
        {"top": '<default><default class="light"><joint damping=".2"/></default></default>',
         "free": '<joint class="light" type="free"/>'}, OFF,
        "freejoint: damping 0.2, of the default class light"),
    "gimbal": Case({"plate": _PENDULUM.format(joint='damping=".02"', geom=_GHOST)}, RIGHT, ""),
    "spring": Case({"axle": 'stiffness=".5"'}, RIGHT, ""),
    "stiff spring": Case({"axle": 'stiffness="40"'}, OFF, "stands still"),
    "slider": Case(
        {"plate": '<body name="mass"><joint name="s" type="slide" axis="1 0 0" stiffness="60" '
                  f'damping="2"/><geom size=".01" mass=".1" {_GHOST}/></body>'}, RIGHT, ""),
    "ball joint": Case({"plate": '<body name="arm"><joint type="ball"/><geom size=".01" '
                        f'{_GHOST}/></body>'}, REFUSED, "use three hinges"),
    "motor of a ball joint": Case(
        {"plate": f'<body><joint name="j" type="ball"/><geom size=".01" {_GHOST}/></body>',
         "drive": '<motor name="drive" joint="j"/>'}, REFUSED, "moves a free or a ball joint"),
    "thruster": Case({"shell": '<site name="jet"/>', "drive": '<motor name="drive" site="jet"/>'},
                     REFUSED, "drive moves no joint"),
    "position servo": Case(
        {"drive": '<position name="drive" joint="axle" kp="2" kv=".2"/>',
         "key": '<keyframe><key ctrl="1.2"/></keyframe>'}, RIGHT, ""),
    "velocity servo": Case(
        {"drive": '<velocity name="drive" joint="axle" kv=".05"/>',
         "key": '<keyframe><key ctrl="5"/></keyframe>'}, RIGHT, ""),
    "fixed tendon": Case(
        {"plate": _PENDULUM.format(joint='damping=".02"', geom=_GHOST), "tendon": '<tendon><fixed '
         'name="t"><joint joint="axle" coef="1"/><joint joint="tilt" coef=".2"/></fixed></tendon>',
         "drive": '<motor name="drive" tendon="t"/>'}, RIGHT, ""),
    "tendon with a spring": Case(
        {"tendon": '<tendon><fixed name="t" stiffness="1"><joint joint="axle" coef="1"/></fixed>'
         "</tendon>"}, REFUSED, "a tendon with a spring"),
    "muscle": Case({"drive": '<muscle name="drive" joint="axle"/>'}, REFUSED, "Lengthrange"),
    "equality": Case({"plate": _PENDULUM.format(joint="", geom=_GHOST), "tendon":
                      '<equality><joint joint1="axle" joint2="tilt"/></equality>'}, REFUSED,
                     "an equality constraint"),
    # how a file is written
    "defaults": Case({"top": '<default><joint damping=".01"/><default class="look"><geom '
                      f'{_GHOST}/></default></default>', "bob": 'class="look"'}, RIGHT, ""),
    "defaults with a class of a geom": Case(
        {"top": '<default><geom condim="3" friction="20 .005 .0001"/></default>', **_NO_PAIR}, OFF,
        "softness: ", ("--accuracy", "5e-5")),
    "two keyframes": Case(
        {"key": '<keyframe><key name="a" ctrl="0"/><key name="b" ctrl=".1"/></keyframe>'}, RIGHT,
        "", ("--keyframe", "b")),
    "no keyframe": Case({"key": ""}, RIGHT, "No control given"),
    "two robots": Case(
        {"world": '<body name="other" pos="1 0 .15"><freejoint/><geom name="twin" type="sphere" '
         'size=".15" mass="1"/></body>'}, REFUSED, "choose one with `--shell`"),
    "two robots, one named": Case(
        {"world": '<body name="other" pos="1 0 .15"><freejoint/><geom name="twin" type="sphere" '
         'size=".15" mass="1"/></body>'}, RIGHT, "other is not part of", ("--shell", "ball")),
    "a missing picture": Case(
        {"top": '<asset><texture name="t" type="2d" file="no.png"/><material name="m" '
         'texture="t"/></asset>', "solid": 'material="m"'}, RIGHT, "no.png is missing"),
    "a missing mesh": Case(
        {"top": '<asset><mesh name="m" file="no.stl"/></asset>',
         "shell": '<geom type="mesh" mesh="m"/>'}, REFUSED, "gives ball its mass"),
    "a missing include": Case({"top": '<include file="no.xml"/>'}, REFUSED, "no.xml"),
    "URDF": Case({"file": _URDF.format("continuous")}, RIGHT, "because a URDF has none"),
    "URDF with stops": Case({"file": _URDF.format("revolute")}, OFF, ""),
    "URDF of one fixed body": Case({"file": _URDF.format("fixed")}, RIGHT, ""),
    "URDF of a solid base": Case({"file": _SOLID_BASE}, RIGHT, "bob has no joint"),
    "drag": Case({"top": '<option density="1.2" viscosity="1e-5"/>'}, REFUSED, "drag of a medium"),
    "no friction": Case({"pair": _USUAL["pair"].replace("20 20", ".01 .01")}, RIGHT, "friction: "),
    "default contact": Case(_NO_PAIR, OFF, "softness: ", ("--accuracy", "5e-5")),
}  # fmt: skip
