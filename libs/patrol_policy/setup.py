"""Where colcon looks for the package; all else is in pyproject.toml."""

from setuptools import setup

setup(
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/patrol_policy']),
        ('share/patrol_policy', ['package.xml']),
    ]
)
