"""The controller and the servos' electronics in MuJoCo, which simulates the arm and what it touches.

    pip install ./python numpy "mujoco>=3.2"
    python python/examples/mujoco_arm.py

The base turns the arm against a post. The servo of joint 1 presses, the firmware notices that the joint is blocked, and limits the
push. MuJoCo tells the force on the post.
"""

from __future__ import annotations

import mujoco  # type: ignore[import-untyped,unused-ignore]
import numpy as np
from numpy.typing import NDArray

import sevenbot

Numbers = NDArray[np.float64]

REST = np.array([90.0, 90, 65, 90, 90, 90, 80])
JOINTS = 6
"""The model has no claw: joint 7 stays in our simulation."""
PERIOD = 0.02
"""Between two actions, in seconds."""
POST = """
    <geom name="post" type="cylinder" size="0.02" fromto="0.2 0.09 -0.06 0.2 0.09 0.4" conaffinity="1" rgba="0.8 0.3 0.2 1"/>
  </worldbody>"""


class MujocoArm:
    """An arm whose joints MuJoCo moves. It starts in the pose of rest."""

    def __init__(self, xml: str) -> None:
        self.arms = sevenbot.SimulatedArms(1)
        self.model = mujoco.MjModel.from_xml_string(xml)
        self.data = mujoco.MjData(self.model)
        # The model's zero is the pose of rest. The actuator of a joint has the joint's name.
        names = [f"joint_{number}" for number in range(1, JOINTS + 1)]
        joints = [self.model.joint(name) for name in names]
        self.positions = np.array([joint.qposadr[0] for joint in joints])
        self.velocities = np.array([joint.dofadr[0] for joint in joints])
        self.actuators = np.array([self.model.actuator(name).id for name in names])
        self.gains = self.model.actuator_gainprm[self.actuators, 0].copy()
        self.biases = self.model.actuator_biasprm[self.actuators, 1:3].copy()
        self.stall = self.model.actuator_forcerange[self.actuators, 1]

    def step(self, action: Numbers) -> Numbers:
        """Sends an action of seven angles in degrees, lets 20 ms pass, and reads an observation of 32 numbers."""
        self.arms.send(action[None], PERIOD)
        timestep = self.model.opt.timestep
        for _ in range(round(PERIOD / timestep)):
            self.drive(self.arms.exchange(self.measured(), timestep)[0])
            mujoco.mj_step(self.model, self.data)
        observation: Numbers = self.arms.read()[0]
        return observation

    def measured(self) -> Numbers:
        """What the sensors of the servos see: degrees, degrees per second, and percent of the stall torque."""
        measured = np.full((1, 3, 7), np.nan)
        measured[0, 0, :JOINTS] = REST[:JOINTS] + np.degrees(self.data.qpos[self.positions])
        measured[0, 1, :JOINTS] = np.degrees(self.data.qvel[self.velocities])
        measured[0, 2, :JOINTS] = 100 * self.data.actuator_force[self.actuators] / self.stall
        return measured.reshape(1, 21)

    def drive(self, wanted: Numbers) -> None:
        """Sets what the actuators aim at. A motor without torque has no gain."""
        arms = self.arms
        set_points, velocities = wanted[arms.SET_POINTS], wanted[arms.SET_VELOCITIES]
        driven = wanted[arms.DRIVES][:JOINTS] == 1
        self.model.actuator_gainprm[self.actuators, 0] = self.gains * driven
        self.model.actuator_biasprm[self.actuators, 1:3] = self.biases * driven[:, None]
        # The servo's derivative term acts on the error, MuJoCo's on the velocity alone. This lead time makes them equal.
        lead = self.biases[:, 1] / self.biases[:, 0]
        aim = (set_points - REST)[:JOINTS] + lead * velocities[:JOINTS]
        self.data.ctrl[self.actuators] = np.radians(aim)


def main() -> None:
    arm = MujocoArm(sevenbot.model("mjcf").replace("</worldbody>", POST.strip()))
    target = REST.copy()
    print("   time   target  joint 1     load  blocked  force on the post")
    for step in range(200):
        target[0] = min(90 + step * PERIOD * 20, 130)
        seen = arm.step(target)
        force = np.zeros(6)
        if arm.data.ncon:
            mujoco.mj_contactForce(arm.model, arm.data, 0, force)
        if step % 20 == 19:
            load, blocked = seen[arm.arms.LOADS][0], seen[arm.arms.BLOCKED][0]
            print(f"{(step + 1) * PERIOD:5.1f} s {target[0]:6.1f} ° {seen[0]:6.1f} ° {load:6.1f} % {blocked:8.0f} {force[0]:13.1f} N")


if __name__ == "__main__":
    main()
