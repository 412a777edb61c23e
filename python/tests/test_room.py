"""The room of a simulated arm: a table, walls, and things that it grips and pushes."""

from collections.abc import Iterator

import pytest

import sevenbot


@pytest.fixture
def arm() -> Iterator[sevenbot.Arm]:
    with sevenbot.Arm.simulated() as arm:
        yield arm


def test_a_cube_is_gripped_and_dropped(arm: sevenbot.Arm) -> None:
    world = arm.simulation
    assert world.scene is None and world.things == {}
    world.scene = "cube red 30 40 0 200"
    assert world.things == {"red": [0.0, 200.0, -45.0]}
    for z, claw in [(75, 60), (15, 60), (15, 10), (75, 10)]:
        arm.move_to(0, 200, z, straight=True)
        arm.set("target-position.7", claw)
        arm.sleep(1)
    x, y, z = world.things["red"]
    assert abs(x) < 5 and abs(y - 200) < 6 and abs(z - 15) < 6
    assert world.load_grams == 40
    world.drop_load()
    arm.sleep(1)
    assert world.things["red"][2] == pytest.approx(-45)
    world.scene = None
    assert world.things == {}


def test_a_text_that_is_no_scene_is_refused_with_its_line(arm: sevenbot.Arm) -> None:
    with pytest.raises(ValueError, match="line 2 of the scene: use table Z"):
        arm.simulation.scene = "cube red 30 40 0 200; sphere 3"
    assert arm.simulation.scene is None
