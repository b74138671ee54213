from glob import glob

from setuptools import find_packages, setup

package_name = 'surveillance_behaviour'

setup(
    name=package_name,
    version='0.1.0',
    packages=find_packages(),
    package_data={'': ['py.typed']},
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml']),
        ('share/' + package_name + '/launch', glob('launch/*.launch.py')),
        ('share/' + package_name + '/config', glob('../config/*.yaml')),
        ('share/' + package_name + '/config/robots', glob('../config/robots/*.yaml')),
    ],
    zip_safe=True,
    maintainer='Surveillance robot maintainers',
    maintainer_email='surveillance@example.com',
    description='Patrol policies, missions and the state machines of the robot.',
    license='Apache-2.0',
    entry_points={
        'console_scripts': [
            'initial_state = surveillance_behaviour.initial_state_node:main',
            'reasoner = surveillance_behaviour.reasoner_node:main',
            'robot_behavior = surveillance_behaviour.robot_behavior_node:main',
        ],
    },
)
