from setuptools import find_packages, setup

package_name = 'surveillance_ontology'

setup(
    name=package_name,
    version='0.1.0',
    packages=find_packages(),
    package_data={'': ['py.typed'], 'surveillance_ontology': ['data/*.owl']},
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml']),
    ],
    zip_safe=True,
    maintainer='Surveillance robot maintainers',
    maintainer_email='surveillance@example.com',
    description="OWL ontology service with ARMOR's interface, its reasoner, and the map builder.",
    license='Apache-2.0',
    entry_points={
        'console_scripts': [
            'armor_server = surveillance_ontology.armor_server_node:main',
            'ontology_map_builder = surveillance_ontology.ontology_map_builder_node:main',
        ],
    },
)
