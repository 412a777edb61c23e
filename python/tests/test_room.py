"""The room of a simulated arm: a table, and things that the arm grips and drops."""

from __future__ import annotations

import pytest

import sevenbot


def test_a_cube_is_gripped_and_dropped(simulated_arm: sevenbot.Arm) -> None:
    world = simulated_arm.simulation
    assert world is not None
    assert world.scene is None and world.things == {}
    world.scene = "cube red 30 40 0 200"
    assert world.things == {"red": [0.0, 200.0, -45.0]}
    simulated_arm.set("effector-type", 1)
    for height, claw in [(75, 60), (15, 60), (15, 10), (75, 10)]:
        simulated_arm.move_to(0, 200, height, straight=True)
        simulated_arm.set("target-position.7", claw)
        simulated_arm.sleep(1)
    x, y, z = world.things["red"]
    assert abs(x) < 5 and abs(y - 200) < 6 and abs(z - 15) < 6
    assert world.load_grams == 40
    world.drop_load()
    simulated_arm.sleep(1)
    assert world.things["red"][2] == pytest.approx(-45)
    world.scene = None
    assert world.things == {}


def test_a_text_that_is_no_scene_is_refused_with_its_line(simulated_arm: sevenbot.Arm) -> None:
    world = simulated_arm.simulation
    assert world is not None
    with pytest.raises(ValueError, match="line 2 of the scene: use table Z"):
        world.scene = "cube red 30 40 0 200; sphere 3"
    assert world.scene is None
