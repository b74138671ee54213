from setuptools import find_packages, setup

package_name = 'surveillance_perception'

setup(
    name=package_name,
    version='0.1.0',
    packages=find_packages(),
    package_data={'': ['py.typed']},
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml']),
        ('share/' + package_name + '/config', ['../config/markers.yaml']),
    ],
    zip_safe=True,
    maintainer='Surveillance robot maintainers',
    maintainer_email='surveillance@example.com',
    description='ArUco detection, marker server and camera arm of the surveillance robot.',
    license='Apache-2.0',
    entry_points={
        'console_scripts': [
            'aruco_detector = surveillance_perception.aruco_detector_node:main',
            'arm_controller = surveillance_perception.arm_controller_node:main',
            'marker_server = surveillance_perception.marker_server_node:main',
            'observer = surveillance_perception.observer_node:main',
            'video_source = surveillance_perception.video_source_node:main',
        ],
    },
)
