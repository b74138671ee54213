"""The simulated place.

- `simulated_place`: walls, doors, obstacles and markers as they are now (`SimulatedPlace`);
- `people`: people who walk in it; `textures`: what surfaces look like.
"""
