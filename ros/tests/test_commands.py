"""What the node makes of commands: without ROS and without an arm."""

from __future__ import annotations

import math
import random

import pytest
import sevenbot
from sevenbot_ros.commands import Refusal, Rules, Targets, Throttle, check
from sevenbot_ros.follower import Follower, Jump
from sevenbot_ros.joints import LINKAGE, NAMES, PASSIVE, ZEROS, Limits, to_degrees, to_radians, with_passive

STANDING = (90.0, 90.0, 65.0, 90.0, 90.0, 90.0, 80.0)
RULES = Rules()


def refusal(names: list[str], positions: list[float], stamp: float | None = None, now: float = 100.0) -> str:
    answer = check(RULES, names, positions, stamp, now)
    assert isinstance(answer, Refusal), answer
    return answer.key


def accepted(names: list[str], positions: list[float], stamp: float | None = None, now: float = 100.0) -> Targets:
    answer = check(RULES, names, positions, stamp, now)
    assert isinstance(answer, Targets), answer
    return answer


def test_zero_of_the_model_is_the_straight_pose() -> None:
    assert to_radians(ZEROS) == [0.0] * 7
    assert accepted(list(NAMES), [0.0] * 7).degrees == dict(enumerate(ZEROS))


def test_angles_go_there_and_back() -> None:
    generator = random.Random(5)
    for _ in range(1000):
        degrees = [generator.uniform(0, 180) for _ in NAMES]
        back = [to_degrees(joint, angle) for joint, angle in enumerate(to_radians(degrees))]
        assert back == pytest.approx(degrees, abs=1e-9)


def test_passive_joints_follow() -> None:
    angles = with_passive([0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7])
    assert angles == pytest.approx([0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, -0.2, 0.35, -0.35])
    assert len(angles) == len(NAMES) + len(PASSIVE)


def test_commands_that_are_refused() -> None:
    assert refusal(["joint_8"], [0.0]) == "unknown joint"
    assert refusal(["joint_1", "elbow"], [0.0, 0.0]) == "unknown joint"
    assert refusal(["joint_1", "joint_1"], [0.0, 0.0]) == "twice"
    assert refusal(["joint_1"], []) == "length"
    assert refusal([], []) == "empty"
    assert refusal(["joint_1"], [math.nan]) == "NaN"
    assert refusal(["joint_1"], [math.inf]) == "range joint_1"
    assert refusal(["joint_1"], [1.58]) == "range joint_1"
    assert refusal(["joint_3"], [-1.2]) == "range joint_3"
    assert refusal(["joint_7"], [math.radians(85)]) == "range joint_7"


def test_old_and_future_stamps_are_refused() -> None:
    assert refusal(["joint_1"], [0.0], stamp=99.4) == "old"
    assert refusal(["joint_1"], [0.0], stamp=100.6) == "future"
    assert accepted(["joint_1"], [0.0], stamp=99.6).degrees == {0: 90.0}
    assert accepted(["joint_1"], [0.0], stamp=None).degrees == {0: 90.0}


def test_a_joint_without_a_controller_has_nan_and_the_others_move() -> None:
    targets = accepted(["joint_1", "joint_7"], [0.1, math.nan])
    assert set(targets.degrees) == {0}
    assert [refused.key for refused in targets.refused] == ["NaN joint_7"]


def test_rounding_at_a_limit_is_the_limit() -> None:
    assert accepted(["joint_1"], [math.pi / 2 + 1e-4]).degrees == {0: 180.0}
    assert accepted(["joint_1"], [-math.pi / 2 - 1e-4]).degrees == {0: 0.0}


def test_parameters_make_the_range_smaller_but_not_greater() -> None:
    limits = Limits.of_arm().within([-1.0] * 7, [3.0] * 7)
    assert limits.low[0] == pytest.approx(90 - math.degrees(1.0))
    assert limits.high == Limits.of_arm().high
    rules = Rules(limits=limits)
    assert isinstance(check(rules, ["joint_1"], [-1.1], None, 0.0), Refusal)
    assert isinstance(check(rules, ["joint_1"], [-0.9], None, 0.0), Targets)


def test_every_accepted_command_is_within_the_range_of_the_arm() -> None:
    generator = random.Random(6)
    low, high = sevenbot.limits()
    for _ in range(5000):
        names = generator.sample(NAMES, generator.randint(1, 7))
        positions = [generator.choice([generator.uniform(-4, 4), math.nan, math.inf, -math.inf]) for _ in names]
        answer = check(RULES, names, positions, None, 0.0)
        if isinstance(answer, Targets):
            assert all(low[joint] <= angle <= high[joint] for joint, angle in answer.degrees.items())


def follower(jump: Jump = Jump.REFUSE) -> Follower:
    return Follower(STANDING, jump=jump)


def test_the_first_point_is_where_the_joint_stands_and_others_have_none() -> None:
    following = follower()
    assert following.take(Targets({0: 90.0})) is None
    assert following.advance(0.02) == [90.0, *[None] * 6]


def test_a_near_first_target_is_approached() -> None:
    following = follower()
    assert following.advance(0.02) == [None] * 7
    assert following.take(Targets({0: 94.0})) is None
    following = follower()
    following.take(Targets({0: 90.0}))
    following.advance(0.02)
    following.take(Targets({0: 94.0}))
    steps = [following.advance(0.02)[0] for _ in range(10)]
    assert steps[-1] == 94.0
    assert following.take(Targets({0: 97.0})) is None
    assert following.advance(0.02)[0] == 97.0


def test_a_target_that_moves_on_is_caught_up_with() -> None:
    following = follower()
    points = []
    for step in range(100):
        assert following.take(Targets({0: 94.0 + step * 0.8})) is None
        points.append(following.advance(0.02)[0])
    assert points[-1] == pytest.approx(94.0 + 99 * 0.8)
    assert not following.is_approaching


def test_targets_that_came_while_the_stream_opened_are_approached() -> None:
    following = follower()
    for step in range(1, 6):
        assert following.take(Targets({0: 90.0 + 4.0 * step})) is None
    assert following.advance(0.0)[0] == 90.0
    assert following.advance(0.02)[0] == pytest.approx(90.6)


def test_a_jump_is_refused_and_the_last_target_stays() -> None:
    following = follower()
    following.take(Targets({0: 91.0}))
    refused = following.take(Targets({0: 97.0}))
    assert refused is not None and refused.key == "jump" and "joint_1" in refused.text
    for _ in range(20):
        point = following.advance(0.02)
    assert point[0] == 91.0


def test_a_jump_is_approached_on_a_straight_line_of_the_joints() -> None:
    following = follower(Jump.APPROACH)
    assert following.take(Targets({0: 150.0, 3: 60.0})) is None
    before = (90.0, 90.0)
    for _ in range(200):
        point = following.advance(0.02)
        assert point[0] is not None and point[3] is not None
        assert abs(point[0] - before[0]) <= 0.6 + 1e-9
        assert (point[0] - 90.0) * 30.0 == pytest.approx((90.0 - point[3]) * 60.0)
        before = (point[0], point[3])
    assert before == (150.0, 60.0)
    assert not following.is_approaching


def test_the_linkage_counts_joints_that_the_command_does_not_name() -> None:
    following = Follower((90, 150, 65, 90, 90, 90, 80), jump=Jump.APPROACH)
    refused = following.take(Targets({2: 65 + LINKAGE - 60 + 1}))
    assert refused is not None and refused.key == "linkage"
    assert following.take(Targets({2: 65 + LINKAGE - 60 - 1})) is None


def test_an_arm_that_a_hand_left_outside_may_come_back() -> None:
    following = Follower((90, 160, 70, 90, 90, 90, 80), jump=Jump.APPROACH)
    assert following.take(Targets({1: 158.0})) is None
    refused = following.take(Targets({1: 158.5}))
    assert refused is not None and refused.key == "linkage", "further out"
    assert following.take(Targets({1: 150.0})) is None


def test_a_warning_passes_once_in_a_period_and_the_rest_is_counted() -> None:
    throttle = Throttle(5.0)
    passed = [throttle.pass_("NaN", time / 100) for time in range(1000)]
    assert [(index, held) for index, held in enumerate(passed) if held is not None] == [(0, 0), (500, 499)]
    assert throttle.pass_("old", 0.0) == 0
    # After a restart of a simulated clock, the warning passes.
    assert throttle.pass_("NaN", 0.0) is not None
