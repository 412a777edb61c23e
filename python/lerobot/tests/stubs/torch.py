"""Names of torch for LeRobot's base classes, which mention them in annotations only.

The wheels of torch are some gigabytes. The tests of LeRobot's commands use the real package, in the long step.
"""


def __getattr__(name: str) -> type:
    """A class of its own for each name."""
    if name.startswith("__"):
        raise AttributeError(name)
    return type(name, (), {})
