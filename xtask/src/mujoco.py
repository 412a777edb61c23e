"""Compares MuJoCo's forward kinematics of the arm's model with those of the project.

Arguments: the model, and a file with one pose a line: six angles of the joints in radians, then the expected
positions of the tip and of the edge of the disc in metres. Fails above 0.01 mm, or if the actuators do not drive the
arm to the last pose.
"""

import sys

import mujoco
import numpy

LIMIT_MM = 0.01

model = mujoco.MjModel.from_xml_path(sys.argv[1])
data = mujoco.MjData(model)
worst = {"tip": 0.0, "disc_edge": 0.0, "loop of the parallelogram": 0.0}
poses = 0
for line in open(sys.argv[2]):
    numbers = numpy.array([float(word) for word in line.split()])
    angles, expected = numbers[:6], {"tip": numbers[6:9], "disc_edge": numbers[9:12]}
    for number, angle in enumerate(angles, 1):
        data.joint(f"joint_{number}").qpos[0] = angle
    # The passive joints follow from the parallelogram.
    elbow = angles[1] + angles[2]
    data.joint("elbow").qpos[0] = elbow
    data.joint("rod_joint").qpos[0] = -elbow
    mujoco.mj_fwdPosition(model, data)
    for site, position in expected.items():
        error = numpy.linalg.norm(data.site(site).xpos - position) * 1000
        worst[site] = max(worst[site], error)
    equality = data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY
    loop = numpy.abs(data.efc_pos[equality])
    assert loop.size == 3, "the parallelogram is one constraint of three rows"
    worst["loop of the parallelogram"] = max(worst["loop of the parallelogram"], loop.max() * 1000)
    limits = data.efc_type == mujoco.mjtConstraint.mjCNSTR_LIMIT_JOINT
    assert not limits.any() or data.efc_pos[limits].min() > -1e-6, f"a legal pose is beyond a limit: {line}"
    poses += 1
print(f"{poses} poses, MuJoCo {mujoco.__version__}")
for what, error in worst.items():
    print(f"{what}: at most {error:.2e} mm")

# The actuators drive the arm from the straight pose to the last pose: the loop stays closed, and the arm arrives.
mujoco.mj_resetData(model, data)
data.ctrl[:] = angles
opening = 0.0
for _ in range(2000):
    mujoco.mj_step(model, data)
    equality = data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY
    opening = max(opening, numpy.abs(data.efc_pos[equality]).max() * 1000)
error = numpy.linalg.norm(data.site("tip").xpos - expected["tip"]) * 1000
print(f"driven for {data.time:.0f} s: the loop opens by {opening:.2f} mm, the tip stops {error:.1f} mm short")
sys.exit(int(poses == 0 or max(worst.values()) > LIMIT_MM or opening > 5.0 or error > 30.0))
