"""Names of torch for LeRobot's base classes, which mention them in annotations only.

The wheels of torch are some gigabytes. What uses tensors is tested in the long step, with the real one.
"""


def __getattr__(name: str) -> type:
    """A class of its own for each name."""
    if name.startswith("__"):
        raise AttributeError(name)
    return type(name, (), {})
