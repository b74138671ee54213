"""A state machine that calls a ROS action, on plain rclpy nodes, and serves one itself."""

from __future__ import annotations

import contextlib
import threading

import rclpy
from geometry_msgs.msg import Point
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node

import state_machines as fsm
from state_machines.ros import (
    ClockWait,
    GoalRun,
    GoalServer,
    SimpleActionState,
    set_preempt_handler,
)
from surveillance_interfaces.action import FollowPath


def drive(goal: FollowPath.Goal, run: GoalRun) -> FollowPath.Result:
    """Serve the action: visit each point of the path for a moment."""
    for point in goal.path:
        if not run.sleep(0.05):
            break
        run.feedback(FollowPath.Feedback(position=point))
    return FollowPath.Result(position=goal.path[-1])


def machine_on(node: Node) -> fsm.StateMachine:
    """Plan a path, have it followed, and say where the robot is."""

    @fsm.cb_interface(outcomes=['planned'], output_keys=['path'])
    def plan(ud: fsm.UserData) -> str:
        ud.path = [Point(x=float(x), y=0.0, z=0.0) for x in range(1, 4)]
        return 'planned'

    @fsm.cb_interface(outcomes=['told'], input_keys=['position'])
    def tell(ud: fsm.UserData) -> str:
        print(f'arrived at x = {ud.position.x}')
        return 'told'

    machine = fsm.StateMachine(['told', 'aborted', 'preempted'])
    machine.set_clock(ClockWait(node))
    with machine:
        fsm.StateMachine.add('PLAN', fsm.CBState(plan), {'planned': 'FOLLOW'})
        follow = SimpleActionState(
            node,
            'follow_path',
            FollowPath,
            goal_slots=['path'],
            result_slots=['position'],
            feedback_cb=lambda ud, feedback: print(f'passing x = {feedback.position.x}'),
            server_wait_timeout=20.0,
        )
        fsm.StateMachine.add('FOLLOW', follow, {'succeeded': 'TELL'})
        fsm.StateMachine.add('TELL', fsm.CBState(tell))
    return machine


def spin(executor: SingleThreadedExecutor, ended: threading.Event) -> None:
    """Spin until the example has ended, or ROS goes down.

    An executor that another thread shuts down while it spins can fail within rclpy.
    """
    with contextlib.suppress(ExternalShutdownException):
        while not ended.is_set():
            executor.spin_once(timeout_sec=0.1)


def main() -> None:
    """Run a server and a machine that calls it in one process."""
    rclpy.init()
    robot, mission = Node('robot'), Node('mission')
    server = GoalServer(robot, FollowPath, 'follow_path', drive)
    executor = SingleThreadedExecutor()
    for node in (robot, mission):
        executor.add_node(node)
    ended = threading.Event()
    thread = threading.Thread(target=spin, args=(executor, ended))
    thread.start()
    machine = machine_on(mission)
    set_preempt_handler(mission, machine)
    try:
        print('ended with', machine.execute())
    finally:
        server.stop()
        ended.set()
        thread.join()
        executor.shutdown()
        for node in (robot, mission):
            node.destroy_node()
        rclpy.try_shutdown()


if __name__ == '__main__':
    main()
