from setuptools import find_packages, setup

package_name = 'surveillance_operator'

setup(
    name=package_name,
    version='0.1.0',
    packages=find_packages(),
    package_data={'': ['py.typed', 'page/static/*']},
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml']),
    ],
    zip_safe=True,
    maintainer='Surveillance robot maintainers',
    maintainer_email='surveillance@example.com',
    description='Terminal view, live page, console, recordings and reports of the robot.',
    license='Apache-2.0',
    entry_points={
        'console_scripts': [
            'alarm = surveillance_operator.alarm_node:main',
            'console = surveillance_operator.console_node:main',
            'mission_markers = surveillance_operator.mission_markers_node:main',
            'mission_page = surveillance_operator.mission_page_node:main',
            'mission_recorder = surveillance_operator.mission_recorder_node:main',
            'mission_view = surveillance_operator.mission_view_node:main',
        ],
    },
)
