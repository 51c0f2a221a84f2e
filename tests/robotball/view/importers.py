"""Read a model file with an engine's importer and return the robot's numbers at hinge angle 0."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from robotball.robot.ball import Solid, composed
from robotball.rotations import rotation_matrix

_Hinges = dict[str, tuple[Any, float]]


def _solid(mass: float, centre: Any, axes: Any, inertia: Any) -> Solid:
    """Return a body in world axes from its inertia (3,) or (3, 3) in local axes (3, 3)."""
    own = np.diag(inertia) if np.ndim(inertia) == 1 else inertia
    return Solid(float(mass), np.array(centre), axes @ own @ np.transpose(axes))


def plain(
    axes: Any, place: Any, bodies: list[Solid], hinges: _Hinges, gravity: Any, freedoms: int
) -> dict[str, Any]:
    """Return a robot, read in world axes, as plain data relative to the shell.

    axes (3, 3), place (3,) [m]: of the shell; hinges: axis (3,) and armature [kg m²] by name;
    gravity (3,) [m/s²], world; freedoms: number of degrees of freedom.
    """
    turn, whole = np.transpose(axes), composed(bodies)
    # In every format and engine, hinges have the names of their bodies.
    names = {name: name.rpartition("/")[2].removesuffix("_hinge") for name in hinges}
    return {
        "mass": whole.mass,
        "centre": (turn @ (whole.centre - place)).tolist(),
        "inertia": (turn @ whole.inertia @ axes).tolist(),
        "axes": {names[name]: (turn @ axis).tolist() for name, (axis, _) in hinges.items()},
        "armature": {names[name]: float(armature) for name, (_, armature) in hinges.items()},
        "gravity": np.asarray(gravity, dtype=float).tolist(),
        "freedoms": freedoms,
    }


def _mujoco(path: str, form: str) -> dict[str, Any]:
    import mujoco

    model = mujoco.MjModel.from_xml_path(path)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    shell, turns = model.body("shell").id, data.ximat.reshape(-1, 3, 3)
    every = zip(model.body_mass, data.xipos, turns, model.body_inertia, strict=True)
    bodies = [_solid(*element) for element in every][1:]
    hinges = {
        model.joint(i).name: (data.xaxis[i], model.dof_armature[model.jnt_dofadr[i]])
        for i in range(model.njnt)
        if model.jnt_type[i] != mujoco.mjtJoint.mjJNT_FREE
    }
    axes = data.xmat[shell].reshape(3, 3)
    return plain(axes, data.xpos[shell], bodies, hinges, model.opt.gravity, model.nv)


def _bullet(path: str, form: str, **options: int) -> dict[str, Any]:
    import pybullet as p

    p.connect(p.DIRECT)
    p.resetSimulation()
    getattr(p, f"load{form}")(path, **options)
    ball = next(i for i in range(p.getNumBodies()) if p.getBodyInfo(i)[0] == b"shell")
    bodies, hinges = [], {}
    for i in range(-1, p.getNumJoints(ball)):
        facts = p.getDynamicsInfo(ball, i)
        place = p.getLinkState(ball, i) if i >= 0 else p.getBasePositionAndOrientation(ball)
        turn = np.reshape(p.getMatrixFromQuaternion(place[1]), (3, 3))
        bodies.append(_solid(facts[0], np.array(place[0]), turn, facts[2]))
        if i < 0:
            axes = turn @ np.reshape(p.getMatrixFromQuaternion(facts[4]), (3, 3)).T
            origin = place[0] - axes @ facts[3]
        elif (joint := p.getJointInfo(ball, i))[2] != p.JOINT_FIXED:
            hinges[joint[1].decode()] = turn @ joint[13], 0.0
    world = p.getPhysicsEngineParameters()
    gravity = [world[f"gravityAcceleration{axis}"] for axis in "XYZ"]
    freedoms = len(p.calculateMassMatrix(ball, [0.0] * len(hinges)))
    return plain(axes, origin, bodies, hinges, gravity, freedoms)


def _dart(path: str, form: str) -> dict[str, Any]:
    from dartpy import simulation, utils

    world = simulation.World()
    if form == "URDF":
        world.addSkeleton(utils.DartLoader().parseSkeleton(path))
    else:
        world = utils.MjcfParser.readWorld(path)
    every = [world.getSkeleton(i) for i in range(world.getNumSkeletons())]
    ball = next(skeleton for skeleton in every if skeleton.getBodyNode("shell"))
    bodies, hinges = [], {}
    for body in ball.getBodyNodes():
        turn, inertia = np.array(body.getTransform().rotation()), body.getInertia()
        bodies.append(_solid(body.getMass(), body.getCOM(), turn, inertia.getMoment()))
        joint = body.getParentJoint()
        if hasattr(joint, "getAxis"):
            own = joint.getTransformFromChildBodyNode().rotation()
            hinges[joint.getName()] = turn @ own @ joint.getAxis(), 0.0
    shell = ball.getBodyNode("shell").getTransform()
    axes, place = np.array(shell.rotation()), np.array(shell.translation())
    return plain(axes, place, bodies, hinges, world.getGravity(), ball.getNumDofs())


def _drake(path: str, form: str) -> dict[str, Any]:
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import MultibodyPlant

    plant = MultibodyPlant(1e-3)
    Parser(plant).AddModels(path)
    plant.Finalize()
    context, shell = plant.CreateDefaultContext(), plant.GetBodyByName("shell")
    whole = plant.CalcSpatialInertia(
        context, plant.world_frame(), plant.GetBodyIndices(shell.model_instance())
    )
    inertia = whole.Shift(whole.get_com()).CalcRotationalInertia().CopyToFullMatrix3()
    bodies, hinges = [Solid(whole.get_mass(), whole.get_com(), inertia)], {}
    motors = [plant.get_joint_actuator(i) for i in plant.GetJointActuatorIndices()]
    reflected = {m.joint().name(): m.calc_reflected_inertia(context) for m in motors}
    for i in plant.GetJointIndices(shell.model_instance()):
        joint = plant.get_joint(i)
        slides = joint.type_name() == "prismatic"
        if slides or joint.type_name() == "revolute":
            axis = joint.translation_axis() if slides else joint.revolute_axis()
            turn = joint.frame_on_parent().CalcPoseInWorld(context).rotation()
            hinges[joint.name()] = turn @ axis, reflected.get(joint.name(), 0.0)
    pose, gravity = plant.EvalBodyPoseInWorld(context, shell), plant.gravity_field()
    axes, freedoms = pose.rotation().matrix(), plant.num_velocities()
    return plain(axes, pose.translation(), bodies, hinges, gravity.gravity_vector(), freedoms)


def _pinocchio(path: str, form: str) -> dict[str, Any]:
    import pinocchio as pin

    free = pin.JointModelFreeFlyer()
    model = pin.buildModelFromMJCF(path) if form == "MJCF" else pin.buildModelFromUrdf(path, free)
    data = model.createData()
    start = pin.neutral(model)
    pin.ccrba(model, data, start, np.zeros(model.nv))
    pin.computeJointJacobians(model, data, start)
    bodies, hinges = [Solid(data.Ig.mass, data.com[0], data.Ig.inertia)], {}
    for i in range(2, model.njoints):
        place = model.joints[i].idx_v
        column = data.J[:, place]
        axis = column[3:] if column[3:].any() else column[:3]
        hinges[model.names[i]] = axis, model.armature[place]
    root, gravity = data.oMi[1], model.gravity.linear
    return plain(root.rotation, root.translation, bodies, hinges, gravity, model.nv)


def _newton(path: str, form: str) -> dict[str, Any]:
    import newton

    builder = newton.ModelBuilder()
    if form == "MJCF":
        builder.add_mjcf(path)
    else:
        builder.add_urdf(path, floating=True)
    model = builder.finalize(device="cpu")

    def placed(pose: Any) -> tuple[Any, Any]:
        return rotation_matrix(pose[[6, 3, 4, 5]]), pose[:3]

    state = model.state()
    newton.eval_fk(model, model.joint_q, model.joint_qd, state)
    poses = [placed(pose) for pose in state.body_q.numpy().astype(float)]
    own = [array.numpy() for array in (model.body_mass, model.body_com, model.body_inertia)]
    bodies = [
        _solid(mass, place + turn @ com, turn, inertia)
        for (turn, place), mass, com, inertia in zip(poses, *own, strict=True)
    ]
    hinges, armatures = {}, model.joint_armature.numpy()
    first, parents = model.joint_qd_start.numpy(), model.joint_parent.numpy()
    for i, frame in enumerate(model.joint_X_p.numpy().astype(float)):
        if parents[i] >= 0:
            axis = placed(frame)[0] @ model.joint_axis.numpy()[first[i]]
            hinges[model.joint_label[i]] = poses[parents[i]][0] @ axis, armatures[first[i]]
    return plain(*poses[0], bodies, hinges, model.gravity.numpy()[0], len(armatures))


# By package and option: the importer, and the formats that it is tested with.
IMPORTERS: dict[str, tuple[Callable[..., dict[str, Any]], tuple[str, ...]]] = {
    "mujoco": (_mujoco, ("MJCF", "URDF")),
    "pybullet": (_bullet, ("URDF", "MJCF")),
    "pybullet, URDF_USE_INERTIA_FROM_FILE": (partial(_bullet, flags=2), ("URDF", "MJCF")),
    "dartpy": (_dart, ("URDF", "MJCF")),
    "pydrake": (_drake, ("URDF", "MJCF")),
    "pinocchio": (_pinocchio, ("URDF", "MJCF")),
    "newton": (_newton, ("URDF", "MJCF")),
}
