from setuptools import find_packages, setup

package_name = 'surveillance_controllers'

setup(
    name=package_name,
    version='0.1.0',
    packages=find_packages(),
    package_data={'': ['py.typed']},
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml']),
    ],
    zip_safe=True,
    maintainer='Surveillance robot maintainers',
    maintainer_email='surveillance@example.com',
    description='Battery, planner and motion controllers of the surveillance robot.',
    license='Apache-2.0',
    entry_points={
        'console_scripts': [
            'battery_controller = surveillance_controllers.battery_controller_node:main',
            'planner_controller = surveillance_controllers.planner_controller_node:main',
            'explorer = surveillance_controllers.explorer_node:main',
            'motion_controller = surveillance_controllers.motion_controller_node:main',
            'collision_monitor = surveillance_controllers.collision_monitor_node:main',
        ],
    },
)
