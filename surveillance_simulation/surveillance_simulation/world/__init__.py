"""The simulated place.

- `world`: walls, doors, obstacles and markers as they are now (`World`, `read_world`);
- `people`: people who walk in it; `textures`: what surfaces look like.
"""
