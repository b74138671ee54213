"""What stands behind `launch.py`: set-up of the environment, the node table and the supervisor."""
