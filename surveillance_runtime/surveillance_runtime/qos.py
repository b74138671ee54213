"""The quality-of-service profiles that the nodes use for topics and services."""

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

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


def _service_qos(depth: int) -> QoSProfile:
    return QoSProfile(
        depth=depth,
        history=HistoryPolicy.KEEP_LAST,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.VOLATILE,
    )


SERVICE_QOS = _service_qos(5000)
"""For servers. The default of rclpy keeps 10 requests and drops further ones without a word, those
of other clients too."""

CLIENT_QOS = _service_qos(2000)
"""For clients of services: answers that arrive while the executor is busy are kept."""

ACTION_SERVER_QOS = {
    f'{service}_service_qos_profile': SERVICE_QOS for service in ('goal', 'result', 'cancel')
}
ACTION_CLIENT_QOS = {
    f'{service}_service_qos_profile': CLIENT_QOS for service in ('goal', 'result', 'cancel')
}
"""The same for the three services of an action, as arguments of rclpy's classes."""
