"""Ten robots that roll correctly, and mistakes to plant in their files."""

from collections.abc import Callable, Mapping

import mujoco
import numpy as np

_FILE = """<mujoco>{default}<option timestep="{step}" integrator="{integrator}" {option}
 cone="{cone}"/>
<worldbody>{floor}<body name="ball" pos="0 0 {height}">{free}
<geom name="shell" type="sphere" size="{radius}" mass="{mass}"/>{inertial}{inside}</body>
</worldbody><contact><pair geom1="{under}" geom2="shell" condim="{condim}"
 friction="{friction} {spin} .0001 .0001" solref="{solref}" solimp="{solimp}"/></contact>
<actuator>{drive}</actuator><keyframe><key {key}/></keyframe></mujoco>"""
_USUAL = {
    "default": "", "step": ".001", "integrator": "RK4", "cone": "elliptic", "option": "",
    "floor": '<geom name="floor" type="plane" size="5 5 .1"/>', "under": "floor",
    "free": "<freejoint/>", "inertial": "", "inside": "", "condim": "3", "friction": "20 20",
    "spin": ".005", "solref": ".004 1", "solimp": ".9999 .9999 .001 .5 1", "drive": "", "key": "",
}  # fmt: skip
_GHOST = 'contype="0" conaffinity="0"'


def _plate(mass: float, depth: float, size: float, more: str = "", damping: str = ".01") -> str:
    """Return a box that hangs on the hinge `axle`, with bodies on it."""
    return (
        f'<body name="plate"><joint name="axle" axis="0 1 0" damping="{damping}"/><geom '
        f'name="bob" type="box" size="{size} {size} {size / 4}" pos="0 0 {-depth}" mass="{mass}" '
        f"{_GHOST}/>{more}</body>"
    )


def _arm(depth: float, mass: float) -> str:
    return (
        '<body name="arm"><joint name="tilt" axis="1 0 0" damping=".01"/><geom name="weight" '
        f'type="sphere" size="{depth / 4}" pos="0 0 {-depth}" mass="{mass}" {_GHOST}/></body>'
    )


_WHEEL = (
    '<body name="wheel"><joint name="spin" axis="0 0 1" damping=".0001"/><geom type="cylinder" '
    f'size=".04 .008" mass=".3" {_GHOST}/></body>'
)
_MOTOR = '<motor name="drive" joint="axle"/>'
_SLIDER = (
    '<body name="rod"><joint name="axle" type="slide" axis="1 0 0" stiffness="60" damping="2"/>'
    f'<geom size=".02" mass=".2" {_GHOST}/></body>'
)
ROBOTS = {
    "pendulum": {"radius": ".15", "mass": ".6", "inside": _plate(0.8, 0.05, 0.05),
                 "drive": _MOTOR, "key": 'ctrl=".1"'},
    "velocity servo": {"radius": ".15", "mass": ".6", "inside": _plate(0.8, 0.05, 0.05),
                       "drive": '<velocity name="drive" joint="axle" kv=".05"/>',
                       "key": 'ctrl="5"'},
    "position servo": {"radius": ".12", "mass": ".4", "inside": _plate(0.6, 0.04, 0.04),
                       "drive": '<position name="drive" joint="axle" kp="1" kv=".1"/>',
                       "key": 'ctrl=".8"'},
    "gimbal": {"radius": ".2", "mass": "1", "inside": _plate(0.7, 0.05, 0.05, _arm(0.08, 0.4)),
               "drive": _MOTOR + '<motor name="lean" joint="tilt"/>', "key": 'ctrl=".2 .05"'},
    "flywheel": {"radius": ".15", "mass": ".6", "inside": _plate(0.8, 0.05, 0.05, _WHEEL),
                 "drive": _MOTOR + '<velocity name="gyro" joint="spin" kv=".01"/>',
                 "key": 'ctrl=".06 20"'},
    "small": {"radius": ".04", "mass": ".05", "inside": _plate(0.06, 0.012, 0.012, damping=".0002"),
              "drive": _MOTOR, "key": 'ctrl=".002"'},
    "large": {"radius": ".5", "mass": "6", "inside": _plate(9.0, 0.2, 0.15), "drive": _MOTOR,
              "key": 'ctrl="4"'},
    "spring": {"radius": ".15", "mass": ".8", "inside": _SLIDER,
               "drive": '<motor name="drive" joint="axle"/>', "key": 'qvel=".5 0 0 0 {turn} 0 0"'},
    "rubber": {"radius": ".15", "mass": ".6", "inside": _plate(0.8, 0.05, 0.05), "condim": "4",
               "spin": "20", "drive": _MOTOR, "key": 'ctrl=".1"'},
    "light shell": {"radius": ".1", "mass": ".15", "inside": _plate(0.5, 0.03, 0.03),
                    "drive": _MOTOR, "key": 'ctrl=".05"'},
}  # fmt: skip
_STOPS = "-15 15", "-.003 .003"  # degrees or m
_Fields = Mapping[str, str]


def _stiff(fields: _Fields) -> _Fields:
    """Return a velocity servo whose gain is 40 times too high for Euler."""
    model = mujoco.MjModel.from_xml_string(text_of(fields))
    data, inverse = mujoco.MjData(model), np.zeros((1, model.nv))
    mujoco.mj_forward(model, data)
    dof = int(model.joint("axle").dofadr[0])
    mujoco.mj_solveM(model, data, inverse, np.eye(model.nv)[dof : dof + 1])
    gain = 40.0 / (model.opt.timestep * float(inverse[0, dof]))
    servo = f'<velocity name="drive" joint="axle" kv="{gain:.4g}"/>'
    return {"integrator": "Euler", "drive": servo, "key": 'ctrl="3"'}


def _at(part: float) -> Callable[[_Fields], _Fields]:
    return lambda fields: {"height": f"{float(fields['radius']) * (1 + part):.6g}"}


def _inertia(factor: float, depth: float) -> Callable[[_Fields], _Fields]:
    def planted(fields: _Fields) -> _Fields:
        mass, radius = float(fields["mass"]), float(fields["radius"])
        moment = f"{factor * mass * radius**2:.4g}"
        place = f"0 0 {-depth * radius:.4g}"
        return {
            "inertial": f'<inertial mass="{mass}" pos="{place}" '
            f'diaginertia="{moment} {moment} {moment}"/>'
        }

    return planted


def _fixed(**fields: str) -> Callable[[_Fields], _Fields]:
    return lambda _: fields


def _driven(attributes: str) -> Callable[[_Fields], _Fields]:
    """Return a mistake: attributes of the actuator `drive`."""
    return lambda fields: {
        "drive": fields["drive"].replace('name="drive"', f'name="drive" {attributes}')
    }


def _by_class(**attributes: str) -> Callable[[_Fields], _Fields]:
    """Return a mistake: attributes of a default class, in place of those of the pair."""

    def planted(fields: _Fields) -> _Fields:
        geom = {name: fields[name] for name in ("condim", "solref", "solimp")}
        geom["friction"] = f"{fields['friction'].split()[0]} {fields['spin']} .0001"
        words = " ".join(f'{name}="{value}"' for name, value in {**geom, **attributes}.items())
        return {"default": f"<default><geom {words}/></default>", "under": ""}

    return planted


def _far(fields: _Fields) -> _Fields:
    """Return a ghost that hangs 200 radii below the sphere, on the ball."""
    mass, away = float(fields["mass"]) / 5, 200 * float(fields["radius"])
    ghost = f'<geom size=".01" pos="0 0 {-away:.4g}" mass="{mass:.4g}" {_GHOST}/>'
    return {"inside": ghost + fields["inside"]}


# The name begins with the cause. Each returns the changed fields of a robot.
PLANTED: dict[str, Callable[[_Fields], _Fields]] = {
    "gain of a servo": _stiff,
    "start above": _at(0.06),
    "start in the floor": _at(-0.03),
    "freejoint missing": lambda fields: {
        "free": "", "key": fields["key"] if fields["drive"] and "qvel" not in fields["key"] else "",
    },
    "freejoint damped": _fixed(default='<default><joint damping=".3"/></default>',
                               free='<joint type="free"/>'),
    "floor missing": _fixed(floor="", under="shell"),
    "inertia too large": _inertia(5.0, 0.0),
    "inertia outside": _inertia(0.4, 20.0),
    "friction": _fixed(friction=".002 .002"),
    "condim": _fixed(condim="1"),
    "softness": _fixed(solref=".3 1", solimp=".5 .6 .01 .5 2"),
    "integrator": _fixed(step=".01", integrator="Euler"),
    "gravity": _fixed(option='gravity=".5 0 -9.81"'),
    "limit": lambda fields: {"inside": fields["inside"].replace(
        'name="axle"', f'name="axle" range="{_STOPS["slide" in fields["inside"]]}"')},
    "range": lambda fields: {
        "inside": fields["inside"].replace('name="axle"', 'name="axle" range="60 -60"')},
    "gear": _driven('gear="0"'),
    "range of a control": _driven('ctrlrange="1 -1"'),
    "range of a force": _driven('forcerange="1 -1"'),
    "ctrlrange": _driven('ctrlrange="-1e-4 1e-4"'),
    "forcerange": _driven('forcerange="-1e-4 1e-4"'),
    "gain below 0": _fixed(drive='<velocity name="drive" joint="axle" kv="-.05"/>', key='ctrl="5"'),
    "inertia far away": _far,
    "start that slides": lambda fields: {
        "key": fields["key"].partition("qvel")[0] + f'qvel="{5 * float(fields["radius"])} 0 0"'},
    "condim of a class": _by_class(condim="1"),
    "friction of a class": _by_class(friction=".002 .005 .0001"),
    "softness of a class": _by_class(solref=".3 1", solimp=".5 .6 .01 .5 2"),
}  # fmt: skip


# Other names that are right, because one causes the other.
AS_WELL = {"integrator": ("timestep",)}
PAIRS = [
    ("gain of a servo", "friction"),
    ("start above", "softness"),
    ("freejoint missing", "gravity"),
    ("inertia too large", "integrator"),
    ("start in the floor", "condim"),
    ("forcerange", "softness of a class"),
    ("ctrlrange", "start above"),
    ("range of a control", "friction of a class"),
    ("gain below 0", "gravity"),
    ("inertia far away", "start that slides"),
]


def text_of(fields: _Fields) -> str:
    """Return the file of a robot."""
    radius = float(fields["radius"])
    whole = {**_USUAL, "height": fields["radius"], **fields}
    whole["key"] = whole["key"].replace("{turn}", f"{0.5 / radius:.9g}")
    text = _FILE.format(**whole)
    if not (whole["floor"] and whole["free"] and whole["under"]):  # a pair needs its geoms
        text = text.replace(text[text.index("<contact>") : text.index("<actuator>")], "")
    return text


def planted(robot: str, *mistakes: str) -> str:
    """Return the file of a robot with mistakes."""
    fields: dict[str, str] = {**_USUAL, **ROBOTS[robot]}
    for mistake in mistakes:
        fields |= PLANTED[mistake](fields)
    return text_of(fields)
