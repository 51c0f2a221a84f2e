"""Scripts in docs/findings/ print their measured values; skipped without the engine."""

import re
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[2] / "docs/findings"
PACKAGES = {
    "mujoco": "mujoco", "warp": "mujoco_warp", "pybullet": "pybullet", "drake": "pydrake",
    "exudyn": "exudyn", "pinocchio": "pinocchio", "dart": "dartpy", "physx": "ovphysx",
    "newton": "newton", "mjx": "jax", "rapier": "rapier3d",
    # Modules of MuJoCo's extra `sysid`, without which its toolbox is empty.
    "mujoco_sysid_contact": "tabulate", "mujoco_sysid_late": "tabulate",
}  # fmt: skip
FIRST_ORDER = "with a rotor: 0.04499 0.04501"  # 0.0450016 in four engines
# For every printed line: its label, and bounds close to the measured value.
EXPECTED = {
    "mujoco_frame_root": "shell root: 8e-4 1e-3; frame root: 1.39 1.42",
    "mujoco_implicitfast":
        f"Euler, alone: 0.0164 0.0166; Euler, {FIRST_ORDER}; "
        f"implicitfast, alone: -0.0158 -0.0156; implicitfast, {FIRST_ORDER}; "
        "implicit, alone: -0.0158 -0.0156; implicit, with a rotor: -0.0367 -0.0365; "
        "RK4, alone: -1e-13 1e-13; RK4, with a rotor: -2e-12 -2e-13",
    "mujoco_rk4_order": "error at 20 ms: 2.9e-7 3.2e-7; order: 3.9 4.1",
    "mujoco_callback_warning":
        "inside, finite state, returned: 1 1; outside, with a warning, returned: 1 1; "
        "inside, with a warning, returned: 0 0",
    "mujoco_condim6": "condim 3: 5e-5 5.5e-5; condim 4: 5e-5 5.5e-5; condim 6: 0.174 0.176",
    "mujoco_rolling_friction":
        "pyramidal, impratio 1, 0.0001 m: -0.03 -0.02; pyramidal, impratio 1, 0.002 m: 0.31 0.34; "
        "pyramidal, impratio 1, 0.006 m: 0.69 0.74; elliptic, impratio 1, 0.0001 m: 0.05 0.065; "
        "elliptic, impratio 1, 0.002 m: 0.99 1; elliptic, impratio 1, 0.006 m: 0.98 1; "
        "pyramidal, impratio 100, 0.0001 m: 0.98 1.02; "
        "pyramidal, impratio 100, 0.002 m: 0.87 0.92; "
        "pyramidal, impratio 100, 0.006 m: 0.85 0.9; elliptic, impratio 100, 0.0001 m: 0.98 1; "
        "elliptic, impratio 100, 0.002 m: 0.98 1; elliptic, impratio 100, 0.006 m: 0.98 1; "
        "elliptic at 0.1 m/s: 0.21 0.23; in contact, 0.015 m at 2 m/s: 0.2 0.4",
    "mujoco_creep":
        "impratio 1: 0.999999 1.000001; impratio 10: 0.999999 1.000001; "
        "impratio 100: 0.999999 1.000001; noslip: -1e-15 1e-15",
    "mujoco_newton_stops":
        "default tolerance, iterations: 0 0; default tolerance, slip: 0.34 0.36; "
        'default tolerance, warnings: 0 0; tolerance="0", iterations: 1 100; '
        'tolerance="0", slip: 4.8e-4 5.3e-4; tolerance="0", warnings: 0 0',
    "mujoco_heavy_ball":
        "Newton, 1 kg: 4.1e-4 4.25e-4; Newton and noslip, 1 kg: 3.6e-4 3.75e-4; "
        "PGS, 1 kg: 4.1e-4 4.25e-4; Newton, 1e+06 kg: 4.1e-4 4.25e-4; "
        "Newton and noslip, 1e+06 kg: 4.1e-4 4.25e-4; PGS, 1e+06 kg: 2.99 3.01",
    # A pyramid ends the slip 1/cos 45° later, and a hop is about 2μ|u|/timeconst over weight.
    "mujoco_slip":
        "default, 5 ms, askew [deg]: 14.4 15.6; default, 5 ms, late [%]: 40 43; "
        "default, 5 ms, error: 0.0098 0.0107; default, 1 ms, askew [deg]: 14.4 15.6; "
        "default, 1 ms, late [%]: 40 43; default, 1 ms, error: 0.0104 0.0113; "
        "default, 0.2 ms, askew [deg]: 14.4 15.6; default, 0.2 ms, late [%]: 40 43; "
        "default, 0.2 ms, error: 0.0104 0.0113; elliptic, 5 ms, rise [mm]: 1.4 1.55; "
        "elliptic, 5 ms, force over weight: 5.1 5.7; elliptic, 5 ms, error: 4e-4 5e-4; "
        "elliptic, 1 ms, rise [mm]: 1.3 1.5; elliptic, 1 ms, force over weight: 5.1 5.7; "
        "elliptic, 1 ms, error: 4.5e-4 5.4e-4; elliptic, 0.2 ms, rise [mm]: 1.3 1.5; "
        "elliptic, 0.2 ms, force over weight: 5.1 5.7; elliptic, 0.2 ms, error: 4.4e-4 5.2e-4; "
        "cure, 5 ms, rise [mm]: 0 6.2e-3; cure, 5 ms, error: 6.8e-6 7.8e-6; "
        "cure, 1 ms, late [%]: -0.3 0.1; cure, 1 ms, rise [mm]: 0 2.9e-4; "
        "cure, 1 ms, force over weight: 1 1.0002; cure, 1 ms, error: 2.4e-7 2.9e-7; "
        "cure, 0.2 ms, rise [mm]: 0 1.2e-5; cure, 0.2 ms, error: 2e-8 6e-8",
    "mujoco_dry_friction":
        "default, 5 ms, along [ms]: 15 15; default, 5 ms, error: 8.8e-3 8.93e-3; "
        "hard, 5 ms, along [ms]: 10 10; hard, 5 ms, error: 1.7e-3 1.9e-3; "
        "default, 1 ms, along [ms]: 11 11; default, 1 ms, error: 8.8e-3 8.93e-3; "
        "hard, 1 ms, along [ms]: 2 2; hard, 1 ms, error: 5.1e-4 5.4e-4; "
        "default, 0.2 ms, along [ms]: 10.5 11; default, 0.2 ms, error: 8.8e-3 8.93e-3; "
        "hard, 0.2 ms, along [ms]: 0.1 0.5; hard, 0.2 ms, error: 7.5e-5 8e-5",
    "mujoco_euler_growth":
        "Euler, momentum: 2.1 2.25; Euler, warnings: 0 0; "
        "RK4, momentum: 0.999999998 0.9999999999; RK4, warnings: 0 0",
    "mujoco_reset":
        "enable, time: 0.9 0.945; enable, finite: 1 1; "
        "disable, time: 0.949 0.951; disable, finite: 0 0",
    "mujoco_sysid_contact":
        "default, mass: -5.75 -5.65; default, depth: 12.7 12.95; "
        "default, kv: -0.02 0.08; default, chi2/n: 14.1 14.25; "
        "elliptic, impratio 100, mass: 0.18 0.19; elliptic, impratio 100, depth: -0.36 -0.34; "
        "elliptic, impratio 100, kv: -0.19 -0.16; elliptic, impratio 100, chi2/n: 1.15 1.16; "
        "rolling, Euler, mass: 0.045 0.055; rolling, Euler, depth: -0.055 -0.04; "
        "rolling, Euler, kv: -1.14 -1.12; rolling, Euler, chi2/n: 1.002 1.004; "
        "rolling, RK4, mass: 0.021 0.024; rolling, RK4, depth: -0.001 0.003; "
        "rolling, RK4, kv: -0.053 -0.046; rolling, RK4, chi2/n: 0.9995 1.0002; "
        "rolling, RK4, uncorrected times, mass: -0.047 -0.043; "
        "rolling, RK4, uncorrected times, depth: 0.175 0.185; "
        "rolling, RK4, uncorrected times, kv: 1.06 1.08; "
        "rolling, RK4, uncorrected times, chi2/n: 0.998 0.9985; "
        "standard deviation, mass: 0.0136 0.0138; standard deviation, depth: 0.0319 0.0325; "
        "standard deviation, kv: 0.0498 0.0508",
    "mujoco_sysid_late": "sensor: 0.999999 1.000001; state: -1e-9 1e-9",
    "pybullet_rate_limit": "default: 99.9 100.1; raised: 149.9 150.1",
    "pybullet_change_dynamics":
        "with a damping, base: 0.3 0.3; with a damping, link: 0.2 0.2; "
        "alone, base: 0.1 0.1; alone, link: 0.3 0.3",
    "pybullet_first_order": FIRST_ORDER,
    # A box pulls at 45°, and √2 times as hard.
    "pybullet_slip":
        "cone 0, 5 ms, askew [deg]: 11.2 11.4; cone 0, 5 ms, late [%]: -21 -20; "
        "cone 0, 5 ms, error: 8.4e-3 8.7e-3; cone 0, 1 ms, askew [deg]: 11.2 11.4; "
        "cone 0, 1 ms, late [%]: -19.2 -18.2; cone 0, 1 ms, error: 7.8e-3 8.1e-3; "
        "cone 1, 5 ms, askew [deg]: 0 1e-6; cone 1, 5 ms, error: 7.7e-4 8e-4; "
        "cone 1, 1 ms, askew [deg]: 0 1e-6; cone 1, 1 ms, error: 1.5e-4 1.65e-4",
    "drake_first_order": FIRST_ORDER,
    # The hop is the impulse μ|u|/(1 + 3.5 μ²) of one step.
    "drake_slip":
        "kSap, 5 ms, rise [mm]: 8.4 8.8; kSap, 5 ms, error: 1.5e-3 1.8e-3; "
        "kSap, 1 ms, rise [mm]: 8 8.4; kSap, 1 ms, error: 3e-4 3.7e-4; "
        "kSap, 0.2 ms, rise [mm]: 7.8 8.2; kSap, 0.2 ms, error: 6.5e-5 9e-5; "
        "kSimilar, 5 ms, rise [mm]: 8.4 8.9; kSimilar, 1 ms, rise [mm]: 5.7 6.1; "
        "kSimilar, 0.2 ms, rise [mm]: 1.1 1.3; kLagged, 5 ms, rise [mm]: -1e-6 1e-6; "
        "kLagged, 5 ms, error: 8e-4 8.5e-4; kLagged, 1 ms, error: 1.8e-4 2.1e-4; "
        "kLagged, 0.2 ms, rise [mm]: -1e-6 1e-6; kLagged, 0.2 ms, error: 6e-5 8e-5",
    "drake_cenic": "SAP: 1.999 2.001; RK3: 1.999 2.001; CENIC: -2.001 -1.999",
    # kTamsi, in releases that have it: 7.7e-6 beside either.
    "drake_frozen":
        "kSap, 100 kg m²: 3.4e-5 3.9e-5; kSap, 1e+12 kg m²: 1.0 1.0; "
        "kLagged, 100 kg m²: 7.7e-6 9.5e-6; kLagged, 1e+12 kg m²: 1.0 1.0",
    "drake_stiction":
        "vs 0.01 m/s, slip over vs: 0.23 0.25; vs 0.001 m/s, slip over vs: 0.22 0.25",
    # The integrator's error is from the lever arm of friction in the overlap.
    "drake_fixed_accuracy": "by the config: 6e-4 7.3e-4; by the integrator: 0.95e-5 1.2e-5",
    "exudyn_fast_rotor":
        "NodeRigidBodyEP, GeneralizedAlpha, 2 ms: 6.4e-3 6.9e-3; "
        "NodeRigidBodyEP, GeneralizedAlpha, 0.5 ms: 2.4e-6 2.7e-6; "
        "NodeRigidBodyEP, TrapezoidalIndex2, 2 ms: 0 1e-8; "
        "NodeRigidBodyEP, TrapezoidalIndex2, 0.5 ms: 0 1e-8; "
        "NodeRigidBodyRotVecLG, GeneralizedAlpha, 2 ms: 2.5e-4 2.7e-4; "
        "NodeRigidBodyRotVecLG, GeneralizedAlpha, 0.5 ms: 1.1e-5 1.3e-5; "
        "NodeRigidBodyRotVecLG, TrapezoidalIndex2, 2 ms: 2.4e-4 2.7e-4; "
        "NodeRigidBodyRotVecLG, TrapezoidalIndex2, 0.5 ms: 1.1e-5 1.3e-5",
    "exudyn_sensor_times": "rows: 101 101; off: 0.0074 0.0076",
    "newton_torsional": "default: 0.9999 1.0001; with condim 4: -1e-6 1e-6",
    "mjx_contact_force":
        "constraint: 8.99999 9.00001; free joint: 8.99999 9.00001; "
        "contact force of the copy: 6.99999 7.00001",
    "mjx_nan":
        "MuJoCo, 0.01: 1.0713 1.0715; MuJoCo, 1e-06: 1.0713 1.0715; "
        "MJX, 0.01: 1.0713 1.0715; MJX, 0.01, finite: 1 1; MJX, 1e-06, finite: 0 0",
    "exudyn_explicit":
        "TrapezoidalIndex2, 200 µs: 0 1e-5; RK44, 30 µs: 1e-4 1e-2; RK44, 10 µs: 1e-4 1e-2; "
        "DOPRI5, 10 µs: 0 1e-5; joint accepted: 0 0",
    "pinocchio_rolling": "along: 0 1e-12; across: 1.714 1.715; up: -4.001 -3.999",
    "pinocchio_slip":
        "solve_ncp False, 5 ms, rise [mm]: 9 9.3; solve_ncp False, 5 ms, error: 7.7e-4 8.2e-4; "
        "solve_ncp False, 1 ms, rise [mm]: 8.6 8.9; "
        "solve_ncp False, 1 ms, error: 1.5e-4 1.65e-4; solve_ncp True, 5 ms, rise [mm]: 0 1e-9; "
        "solve_ncp True, 5 ms, error: 7.7e-4 8.2e-4; solve_ncp True, 1 ms, rise [mm]: 0 1e-9; "
        "solve_ncp True, 1 ms, error: 1.5e-4 1.65e-4",
    "pinocchio_drift":
        "corrector 0 /s: 0.1 0.103; corrector 10 /s: 2.4e-3 2.5e-3; "
        "corrector 100 /s: 2.5e-4 2.7e-4",
    "dart_first_order": FIRST_ORDER,
    "dart_slip":
        "default, 5 ms, askew [deg]: 11.2 11.4; default, 5 ms, late [%]: -21 -20; "
        "default, 5 ms, error: 8.4e-3 8.7e-3; default, 1 ms, askew [deg]: 11.2 11.4; "
        "default, 1 ms, late [%]: -19.2 -18.2; default, 1 ms, error: 7.8e-3 8.1e-3; "
        "Associated, 5 ms, rise [mm]: 9 9.3; Associated, 1 ms, rise [mm]: 8.6 8.9; "
        "Coulomb, 5 ms, askew [deg]: 0 1e-4; Coulomb, 5 ms, rise [mm]: -1e-4 1e-4; "
        "Coulomb, 5 ms, error: 7.7e-4 8e-4; Coulomb, 1 ms, error: 1.5e-4 1.65e-4",
    "dart_spin": "spinning: 1.0 1.0; rolling: 0.99999999 1.00000001",
    "physx_rate_limit":
        "started, default: 99.9 100.1; started, raised: 149.9 150.1; driven, default: 149.9 150.1",
    "physx_momentum": "10 ms: -3e-6 3e-6; 1 ms: -3e-6 3e-6; 0.1 ms: 2e-4 5e-4",
    "physx_slip": "10 ms: 2e-3 4e-3; 1 ms: 8e-4 2e-3; 0.1 ms: 5e-3 2e-2",
    "physx_friction":
        "PGS, 5 ms, askew [deg]: 7.3 7.8; PGS, 5 ms, late [%]: -28 -26; "
        "PGS, 5 ms, error: 8.7e-3 9.1e-3; PGS, 1 ms, askew [deg]: 7.2 7.7; "
        "PGS, 1 ms, late [%]: -25.5 -23.5; PGS, 1 ms, error: 8.1e-3 8.5e-3; "
        "TGS, 5 ms, askew [deg]: 0 2e-3; TGS, 5 ms, error: 2e-5 1.5e-4; "
        "TGS, 1 ms, askew [deg]: 0 5e-3; TGS, 1 ms, error: 5e-5 2e-4",
    # 1e-7 per substep, and a rounding of the angle that depends on its size: single precision.
    "rapier_gyroscopic":
        "10 ms: 3e-4 4.5e-4; 1 ms: 3e-3 5e-3; 0.1 ms: 0.03 0.05; "
        "without correction, 0.1 ms: -1e-7 1e-7",
    "rapier_hinge_angle":
        "10 ms: -4e-5 4e-5; 1 ms: -4e-4 -1.5e-4; 0.1 ms: -6e-3 -3e-3",
    "rapier_rate_limit": "default: 47.1 47.2; allowed: 99.9 100.1",
    "warp_single_precision":
        "MuJoCo, 20 ms: -3.1e-7 -3e-7; Warp, 20 ms: -4e-7 -2e-7; "
        "MuJoCo, 5 ms: -6e-10 -5e-10; Warp, 5 ms: -1e-7 -1e-8",
}  # fmt: skip


def printed_by(script: Path, folder: Path) -> dict[str, str]:
    """Return the values that a script prints by label; skip if its engine is not installed."""
    package = PACKAGES.get(script.stem) or PACKAGES[script.stem.partition("_")[0]]
    if find_spec(package) is None:
        pytest.skip(f"needs {package}")
    command = [sys.executable, str(script)]
    printed = subprocess.check_output(command, text=True, cwd=folder, stderr=subprocess.DEVNULL)
    return dict(re.findall(r"^(.+): ([-+.\w]+|(?:\w+ )+[.\d]+)$", printed, re.M))


# Five fits with MuJoCo take half a minute.
LONG = pytest.param("mujoco_sysid_contact", marks=pytest.mark.study)


@pytest.mark.slow
@pytest.mark.parametrize("name", [LONG if n in LONG.values else n for n in EXPECTED])
def test_a_script_prints_its_measured_values(name: str, tmp_path: Path) -> None:
    printed = printed_by(FOLDER / f"{name}.py", tmp_path)
    expected = [line.rsplit(": ", 1) for line in EXPECTED[name].split("; ")]
    missing = [label for label, _ in expected if label not in printed]
    assert missing == [], f"{name}.py prints no number for {missing}, only for {[*printed]}"
    for label, bounds in expected:
        low, high = map(float, bounds.split())
        value = printed[label]
        assert low <= float(value) <= high, f"{name}.py: {label}: {value}, expected {bounds}"


def test_every_script_has_expected_values_and_a_row_on_the_page() -> None:
    """With the script's verdict and reference. It imports nothing of robotball; reports exist."""
    page = (FOLDER.parent / "findings.md").read_text()
    scripts = {file.stem: file.read_text() for file in FOLDER.glob("*.py")}
    assert [n for n in scripts if n not in EXPECTED] == [], "scripts without values in EXPECTED"
    assert [n for n in EXPECTED if n not in scripts] == [], "values in EXPECTED without a script"
    ours = re.compile(r"^\s*(import|from) (robotball|validation)", re.M)
    assert [n for n, text in scripts.items() if ours.search(text)] == [], "scripts import robotball"
    rows = r"^\| \[`(\w+)`\]\(findings/\1\.py\) \| .* \| (\w+) \| (.*) \|$"
    linked = {name: (verdict, where) for name, verdict, where in re.findall(rows, page, re.M)}
    for name, text in scripts.items():
        for line in ("expected", "version"):
            assert f'\nprint("{line}: ' in text, f'{name}.py has no line print("{line}: …")'
        verdicts = re.findall(r'^print\("verdict: (bug|documented|open); (.+)"\)$', text, re.M)
        rule = 'print("verdict: bug|documented|open; REFERENCE")'
        assert len(verdicts) == 1, f"{name}.py needs one line {rule}"
        row = f"| [`{name}`](findings/{name}.py) | … | verdict | reference |"
        assert name in linked, f"docs/findings.md has no row {row}"
        verdict, where = linked[name]
        on_page = verdict, re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", where)  # without its links
        assert on_page == verdicts[0], f"{name}.py has another verdict than docs/findings.md"
    reports = [file.stem for file in (FOLDER / "reports").glob("*.md")]
    named = [name for name, text in scripts.items() if f"see reports/{name}.md" in text]
    assert [n for n in named if n not in reports] == [], "verdicts name reports that do not exist"
    assert [n for n in reports if n not in named] == [], "no verdict names these reports"


SLIDE = """<mujoco><option timestep="1e-4" integrator="RK4" gravity="{} 0 0"/><worldbody><body>
<joint name="slide" type="slide" axis="1 0 0" {}/><geom size="1" mass="1"/></body></worldbody>{}
</mujoco>"""
EQUALITY = '<equality><joint joint1="slide"/></equality>'


def test_the_page_says_what_soft_rows_cost() -> None:
    """With a load of 10 m/s², and with a limit that is met at 1 m/s."""
    mujoco = pytest.importorskip("mujoco")
    page = " ".join((FOLDER.parent / "findings.md").read_text().split())

    def states(load: float, joint: str, equality: str = "", rate: float = 0.0) -> list[list[float]]:
        model = mujoco.MjModel.from_xml_string(SLIDE.format(load, joint, equality))
        data, rows = mujoco.MjData(model), []
        data.qvel[0] = rate
        for _ in range(5000):
            mujoco.mj_step(model, data)
            rows.append([float(data.qpos[0]), float(data.qvel[0])])
        return rows

    stop = 'range="-1 0" limited="true"'
    given = [states(10, stop)[-1][0], states(10, "", EQUALITY)[-1][0]]
    hit = states(0, stop, rate=1.0)
    creep = states(10, 'frictionloss="20"')[-1][1]
    assert given == pytest.approx([3.72e-4] * 2, rel=1e-2)
    for said in (
        f"gives way by {1e3 * given[0]:.2f} mm",
        f"goes {1e3 * max(x for x, _ in hit):.1f} mm beyond",
        f"rebounds at {-hit[-1][1]:.2f} m/s",
        f"creeps at {1e3 * creep:.1f} mm/s",
    ):
        assert said in page
