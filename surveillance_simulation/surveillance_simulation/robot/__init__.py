"""The simulated robot: `robot` moves `base`, `lidar` and `arm_motion` on in time as one."""
