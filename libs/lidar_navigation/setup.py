"""Where colcon looks for the package; all else is in pyproject.toml."""

from setuptools import setup

setup(
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/lidar_navigation']),
        ('share/lidar_navigation', ['package.xml']),
    ],
    # Here, as a text: colcon reads what setup() was given, and understands no other form.
    python_requires='>=3.11',
)
