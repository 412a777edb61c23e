"""For colcon (ament_python) and for pip."""

from glob import glob

from setuptools import setup

NAME = "sevenbot_ros"

setup(
    name=NAME,
    version="3.0.0",
    description="A node of ROS 2 for the 7Bot V2 arm",
    license="MIT OR Apache-2.0",
    packages=[NAME],
    package_data={NAME: ["model/*", "py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/launch", glob("launch/*.py")),
        (f"share/{NAME}/meshes", glob(f"{NAME}/model/*.stl")),
    ],
    python_requires=">=3.10",
    install_requires=["setuptools"],
    # Modules of ROS are not on PyPI under these names, so they are not listed.
    extras_require={"bag": ["rosbags>=0.10"]},
    zip_safe=True,
    entry_points={"console_scripts": ["arm = sevenbot_ros.__main__:main", "bag = sevenbot_ros.bag:main"]},
)
