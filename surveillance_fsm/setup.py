from setuptools import find_packages, setup

package_name = 'surveillance_fsm'

setup(
    name=package_name,
    version='0.1.0',
    packages=find_packages(),
    package_data={'': ['py.typed']},
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml']),
    ],
    python_requires='>=3.11',
    # Machines as data; the ROS part needs rclpy, which comes with ROS.
    extras_require={'yaml': ['PyYAML>=6.0,<7']},
    zip_safe=True,
    maintainer='Surveillance robot maintainers',
    maintainer_email='surveillance@example.com',
    description='SMACH-style hierarchical state machine engine, with states for ROS 2.',
    license='Apache-2.0',
    entry_points={
        'console_scripts': [],
    },
)
