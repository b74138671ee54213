"""Whom the machines talk to: the ports, and what stands behind them on the robot."""
