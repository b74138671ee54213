"""The simulated camera.

- `model`: its lens, light, noise and exposure; `scene`: the world as textured faces;
- `rendering`: pictures of them; `mujoco_rendering`: the same by MuJoCo, where it is installed.
"""
