"""ROS domains that are claimed: each once, and none in which somebody is."""

from __future__ import annotations

import subprocess
import sys

import rclpy

from surveillance_runtime.testing import claim_domain

CLAIM = 'from surveillance_runtime.testing import claim_domain; print(claim_domain())'


def claimed_by_another_process() -> int:
    done = subprocess.run(
        [sys.executable, '-c', CLAIM], capture_output=True, text=True, check=True, timeout=60
    )
    return int(done.stdout)


def test_a_domain_is_claimed_once() -> None:
    mine = claim_domain()
    assert mine not in (claim_domain(), claimed_by_another_process())


def test_a_domain_that_a_node_is_in_is_not_given_away() -> None:
    domain = claimed_by_another_process()
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=domain)
    node = rclpy.create_node('left_over', context=context)
    assert claimed_by_another_process() != domain
    node.destroy_node()
    rclpy.try_shutdown(context=context)
