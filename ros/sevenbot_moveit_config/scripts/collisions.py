"""Which pairs of links MoveIt need not test: computed from the meshes of the description.

    python scripts/collisions.py            # prints the lines for config/7bot_v2.srdf
    python scripts/collisions.py --write    # replaces them there

A pair is left out of the tests if one link is the next above the other that has a shape, if the pair collides in every one of many
random poses, or in none of them. The poses are within the limits of the joints and of the linkage. Needs numpy and python-fcl.
"""

from __future__ import annotations

import argparse
import re
from itertools import combinations
from pathlib import Path
from xml.etree import ElementTree as Xml

import fcl
import numpy as np
from numpy.typing import NDArray
from sevenbot_ros import description
from sevenbot_ros.joints import LINKAGE

SRDF = Path(__file__).parents[1] / "config/7bot_v2.srdf"
POSES = 5000
SEED = 1
PAIRS = re.compile(r"(?<=<!-- begin: pairs -->\n).*?(?=  <!-- end -->)", re.DOTALL)
Matrix = NDArray[np.float64]


class Joint:
    """A joint of the description."""

    def __init__(self, element: Xml.Element) -> None:
        def get(child: str, name: str, default: str = "") -> str:
            found = element.find(child)
            return default if found is None else found.get(name, default)

        self.name = element.get("name", "")
        self.parent, self.child = get("parent", "link"), get("child", "link")
        self.origin = np.array([float(number) for number in get("origin", "xyz").split()])
        self.axis = np.array([float(number) for number in get("axis", "xyz", "0 0 0").split()])
        self.low, self.high = float(get("limit", "lower", "0")), float(get("limit", "upper", "0"))
        self.of, self.factor = get("mimic", "joint"), float(get("mimic", "multiplier", "1"))

    def frame(self, angle: float) -> Matrix:
        """The transform from the child's axes to the parent's axes."""
        x, y, z = self.axis
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        frame = np.eye(4)
        frame[:3, :3] += np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
        frame[:3, 3] = self.origin
        return frame


def mesh(name: str) -> fcl.BVHModel:
    """A mesh in metres."""
    data = (description.MODEL / f"{name}.stl").read_bytes()
    rows = np.frombuffer(data, dtype=[("n", "<f4", 3), ("corners", "<f4", (3, 3)), ("a", "<u2")], offset=84)
    corners = rows["corners"].reshape(-1, 3).astype(float) / 1000
    model = fcl.BVHModel()
    model.beginModel(len(rows), len(corners))
    model.addSubModel(corners, np.arange(len(corners)).reshape(-1, 3))
    model.endModel()
    return model


class Robot:
    """The description, and where its links are."""

    def __init__(self) -> None:
        root = Xml.fromstring(description.urdf(commands="c", states="s", meshes="m"))
        self.joints = [Joint(element) for element in root.findall("joint")]
        self.links = [*description.MESHES, *description.FINGERS]
        self._objects = {name: fcl.CollisionObject(mesh(name)) for name in self.links}
        self._frames: dict[str, Matrix] = {}

    def random_pose(self, generator: np.random.Generator) -> dict[str, float]:
        """A random pose within all limits."""
        while True:
            pose = {joint.name: generator.uniform(joint.low, joint.high) for joint in self.joints if not joint.of}
            if abs(np.degrees(pose["joint_2"] + pose["joint_3"])) <= LINKAGE:
                return pose

    def move(self, pose: dict[str, float]) -> None:
        """Places the links for a pose, in radians."""
        frames = {"base_link": np.eye(4)}
        waiting = list(self.joints)
        while waiting:
            joint = waiting.pop(0)
            if joint.parent not in frames:
                waiting.append(joint)
                continue
            angle = joint.factor * pose[joint.of] if joint.of else pose[joint.name]
            frames[joint.child] = frames[joint.parent] @ joint.frame(angle)
        for name, shape in self._objects.items():
            shape.setTransform(fcl.Transform(frames[name][:3, :3], frames[name][:3, 3]))

    def collide(self, one: str, other: str) -> bool:
        """Do two links touch?"""
        found = fcl.collide(self._objects[one], self._objects[other], fcl.CollisionRequest(), fcl.CollisionResult())
        return bool(found)

    def neighbours(self) -> set[frozenset[str]]:
        """The pairs of a link and its nearest ancestor that has a shape. Links between the two have no shape."""
        parents = {joint.child: joint.parent for joint in self.joints}

        def before(link: str) -> str:
            link = parents[link]
            return link if link in self.links else before(link)

        return {frozenset((link, before(link))) for link in self.links if link != "base_link"}


def pairs() -> list[tuple[str, str, str]]:
    """The pairs, and why each need not be tested."""
    robot, generator = Robot(), np.random.default_rng(SEED)
    hits = dict.fromkeys(combinations(robot.links, 2), 0)
    neighbours = robot.neighbours()
    for _ in range(POSES):
        robot.move(robot.random_pose(generator))
        for one, other in hits:
            if frozenset((one, other)) not in neighbours:
                hits[one, other] += robot.collide(one, other)
    reasons = {0: "Never", POSES: "Always"}
    found = [
        (one, other, "Adjacent" if frozenset((one, other)) in neighbours else reasons.get(count, ""))
        for (one, other), count in hits.items()
    ]
    return [pair for pair in found if pair[2]]


def lines() -> str:
    """The lines of the SRDF."""
    row = '  <disable_collisions link1="{}" link2="{}" reason="{}"/>\n'
    return "".join(row.format(*pair) for pair in pairs())


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--write", action="store_true", help="replace the lines in config/7bot_v2.srdf")
    text = lines()
    if parser.parse_args().write:
        SRDF.write_text(PAIRS.sub(text, SRDF.read_text()))
    else:
        print(text, end="")


if __name__ == "__main__":
    main()
