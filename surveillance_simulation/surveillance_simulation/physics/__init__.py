"""The robot in MuJoCo: its base as a body on wheels, and its lidars as rays that sweep.

It takes the place of `robot.base` and `robot.lidar` for whoever asks how the robot does in a world
that its authors did not write.
"""
