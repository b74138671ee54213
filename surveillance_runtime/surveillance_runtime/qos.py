"""The quality-of-service profiles that the nodes use for topics and services."""

from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from surveillance_fsm.ros.waiting import CLIENT_QOS as CLIENT_QOS
from surveillance_fsm.ros.waiting import SERVICE_QOS as SERVICE_QOS

STATE_QOS = QoSProfile(
    depth=1,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
"""For topics that carry a state: whoever subscribes late gets the last value."""

SENSOR_QOS = QoSProfile(
    depth=5,
    reliability=ReliabilityPolicy.BEST_EFFORT,
    durability=DurabilityPolicy.VOLATILE,
)
"""For streams in which the next message makes up for a lost one."""
