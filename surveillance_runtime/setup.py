from setuptools import find_packages, setup

package_name = 'surveillance_runtime'

setup(
    name=package_name,
    version='0.1.0',
    packages=find_packages(),
    package_data={'': ['py.typed', '*.json', '*.xml']},
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml']),
    ],
    zip_safe=True,
    maintainer='Surveillance robot maintainers',
    maintainer_email='surveillance@example.com',
    description='Shared code of the nodes: parameters, node base class, process life.',
    license='Apache-2.0',
    entry_points={
        'console_scripts': ['nodes = surveillance_runtime.composition:main'],
    },
)
