"""The simulated camera.

- `model`: its lens, its pose on the arm, noise and exposure; `lighting`: shadows, glare and
  vignette; `scene`: the world as textured faces;
- `rendering`: pictures of them; `mujoco_rendering`: the same by MuJoCo, where it is installed.
"""
