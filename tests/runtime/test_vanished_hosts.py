"""What a host sends does not wait for hosts that are gone."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from benchmarks.hosts import Host, may_be_made
from surveillance_runtime.discovery import launched_nodes
from surveillance_runtime.testing import claim_domain

pytestmark = pytest.mark.skipif(
    not may_be_made(), reason='network namespaces need root, unshare and /dev/net/tun'
)

LISTENER = """
import rclpy
from std_msgs.msg import String

rclpy.init()
node = rclpy.create_node('listener')
node.create_subscription(String, 'words', lambda message: None, 10)
print('ready', flush=True)
rclpy.spin(node)
"""
SPEAKER = """
import math
import time
import rclpy
from std_msgs.msg import String

rclpy.init()
node = rclpy.create_node('speaker')
words = node.create_publisher(String, 'words', 10)
while not words.get_subscription_count():
    time.sleep(0.01)
message, longest, tries = String(data='x' * 2000), math.inf, 0
# A machine that stands for a second delays one try or two, hosts that are gone delay each.
while longest >= 1.0 and tries < 5:
    longest, tries, end = 0.0, tries + 1, time.monotonic() + 3.5
    while time.monotonic() < end:
        began = time.monotonic()
        words.publish(message)
        longest = max(longest, time.monotonic() - began)
        time.sleep(0.01)
print(longest)
"""


def test_a_message_is_sent_at_once_while_other_hosts_have_vanished() -> None:
    host = Host(1)
    # Nobody answers for these addresses: what goes to them waits for their hardware addresses.
    gone = ';'.join(f'10.77.0.{number}' for number in range(100, 108))
    environ = {**os.environ, 'ROS_DOMAIN_ID': str(claim_domain()), 'ROS_STATIC_PEERS': gone}
    for name in ('FASTRTPS_DEFAULT_PROFILES_FILE', 'ROS_AUTOMATIC_DISCOVERY_RANGE'):
        environ.pop(name, None)
    environ |= launched_nodes(environ, 'open')
    listener = None
    try:
        listener = subprocess.Popen(
            host.words(sys.executable, '-c', LISTENER),
            env=environ,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )
        assert listener.stdout is not None
        listener.stdout.readline()
        spoken = subprocess.run(
            host.words(sys.executable, '-c', SPEAKER),
            env=environ,
            capture_output=True,
            text=True,
            timeout=60.0,
        )
        assert float(spoken.stdout) < 1.0, spoken.stderr
    finally:
        if listener is not None:
            listener.kill()
            listener.wait()
        host.close()
