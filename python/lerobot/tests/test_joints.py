"""Names, scales and limits of the joints."""

import math
import random

import pytest

from lerobot_robot_sevenbot import joints

HOME = [90.0, 90.0, 65.0, 90.0, 90.0, 90.0, 42.0]


class OfOneNumber:
    """What `lerobot-replay` hands over: a tensor of one number."""

    def __init__(self, value: float) -> None:
        self.value = value

    def __float__(self) -> float:
        return self.value


def action(angles: list[float]) -> dict[str, float]:
    return joints.to_lerobot("pos", angles)


def test_degrees_and_percent() -> None:
    assert joints.keys("pos")[0] == "joint_1.pos" and joints.keys("vel")[6] == "claw.vel"
    assert action(HOME)["joint_3.pos"] == 65
    assert action(HOME)["claw.pos"] == pytest.approx(50)
    assert joints.to_lerobot("load", HOME)["claw.load"] == 42
    assert joints.to_angles(action(HOME)) == pytest.approx(HOME)


def test_an_action_of_tensors() -> None:
    tensors = {key: OfOneNumber(value) for key, value in action(HOME).items()}
    assert joints.to_angles(tensors) == pytest.approx(HOME)


def test_a_wrong_action_is_named() -> None:
    with pytest.raises(ValueError, match="no claw.pos: it needs joint_1.pos"):
        joints.to_angles({key: value for key, value in action(HOME).items() if key != "claw.pos"})
    with pytest.raises(ValueError, match="joint_2.pos=nan"):
        joints.to_angles(action(HOME) | {"joint_2.pos": math.nan})


def test_limits_keep_what_is_inside_and_the_linkage() -> None:
    seed = random.randrange(2**32)
    print("seed", seed)
    dice = random.Random(seed)
    for _ in range(20_000):
        wanted = [dice.uniform(-30, 210) for _ in range(7)]
        given = joints.within_limits(wanted)
        assert all(low <= angle <= high for low, angle, high in zip(joints.LOWEST, given, joints.HIGHEST, strict=True))
        linkage = given[1] + given[2] - joints.LEVEL
        assert joints.LINKAGE[0] - 1e-9 <= linkage <= joints.LINKAGE[1] + 1e-9
        assert joints.within_limits(given) == pytest.approx(given)
    assert joints.within_limits(HOME) == HOME


def test_a_step() -> None:
    wanted = [95.0, 80.0, *HOME[2:]]
    assert joints.within_step(wanted, HOME, 3)[:3] == [93, 87, 65]
    assert joints.differing(wanted, HOME, 0.5) == ["joint_1", "joint_2"]
    assert joints.differing(HOME, HOME, 0) == []


def test_a_way_is_straight() -> None:
    wanted = [100.0, 85.0, *HOME[2:]]
    assert joints.towards(wanted, HOME, 2)[:2] == pytest.approx([92, 89])
    assert joints.towards(wanted, HOME, 10) == pytest.approx(wanted)
    assert joints.towards(HOME, HOME, 1) == HOME
