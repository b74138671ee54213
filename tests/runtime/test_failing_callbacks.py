"""An exception in a callback costs its message; log lines are bounded, whatever is in them."""

from __future__ import annotations

import threading
import time

import pytest
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.msg import ParameterValue
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.qos import QoSProfile
from std_msgs.msg import Int32
from std_srvs.srv import Trigger

from state_machines.ros import ServiceCaller
from state_machines.ros.waiting import CLIENT_QOS
from strict_files.one_line import LONGEST, clean
from surveillance_runtime.logging import (
    LINES_AT_ONCE,
    LINES_PER_SECOND,
    WARNINGS_AT_ONCE,
    WARNINGS_PER_SECOND,
    Allowance,
)
from surveillance_runtime.node import MOST_WAITING, PatrolNode
from surveillance_runtime.waiting import AwaitedEvent


class Failing(PatrolNode):
    """Fails at every odd number, and at every question."""

    def __init__(self, **node_options):
        super().__init__('failing', **node_options)
        self.got = []
        self.level = self.parameter('level', 1, 'Level.')
        self.create_subscription(Int32, 'number', self._on_number, QoSProfile(depth=100))
        self.create_service(Trigger, 'sync', self._on_sync)
        self.create_service(Trigger, 'later', self._on_later)

    def _on_number(self, message):
        if message.data % 2:
            raise LookupError(f'no use for {message.data}\n[ERROR] [other]: forged')
        self.got.append(message.data)

    def _on_sync(self, _request, _response):
        raise ZeroDivisionError('nothing left')

    async def _on_later(self, _request, _response):
        raise ZeroDivisionError('nothing left')


def test_an_exception_in_a_callback_costs_that_message_alone(graph):
    graph.may_fail = True
    said = graph.said()
    node = graph.add(Failing)
    publisher = graph.node.create_publisher(Int32, 'number', 100)
    graph.until(lambda: publisher.get_subscription_count())
    for number in range(10):
        publisher.publish(Int32(data=number))

    def errors() -> list[str]:
        return [line for line in said if 'LookupError' in line]

    graph.until(lambda: node.got == [0, 2, 4, 6, 8] and len(errors()) >= 5)
    assert len(errors()) == 5
    first = errors()[0]
    assert r'callback: LookupError: no use for 1\n[ERROR]' in first
    assert 'test_failing_callbacks.py:' in first


@pytest.mark.parametrize('service', ['sync', 'later'])
def test_a_service_whose_callback_fails_answers_all_the_same(graph, service):
    graph.add(Failing)
    response = ServiceCaller(graph.node, Trigger, service).call(Trigger.Request(), 60.0)
    assert not response.success


def test_requests_that_wait_for_their_answers_are_bounded(graph):
    class Slow(PatrolNode):
        def __init__(self, **options):
            super().__init__('slow', **options)
            self.event, self.open = AwaitedEvent(self), False
            group = ReentrantCallbackGroup()
            self.create_service(Trigger, 'slow', self.on_request, callback_group=group)

        async def on_request(self, request, response):
            await self.event.wait_for(lambda: self.open)
            response.success = True
            return response

    node = graph.add(Slow)
    client = graph.node.create_client(Trigger, 'slow', qos_profile=CLIENT_QOS)
    graph.until(client.service_is_ready)
    asked = [client.call_async(Trigger.Request()) for _ in range(MOST_WAITING + 50)]
    graph.until(lambda: sum(each.done() for each in asked) == 50)
    node.open = True
    node.event.happen()
    graph.until(lambda: all(each.done() for each in asked))
    assert sum(each.result().success for each in asked) == MOST_WAITING


@pytest.mark.parametrize('kind', [SetParameters, SetParametersAtomically])
def test_a_parameter_of_a_type_that_there_is_not_is_refused(graph, kind):
    graph.add(Failing)
    name = 'set_parameters' + ('_atomically' if kind is SetParametersAtomically else '')
    caller = ServiceCaller(graph.node, kind, f'failing/{name}')
    odd = ParameterMessage(name='level', value=ParameterValue(type=255))
    for _ in range(2):
        response = caller.call(kind.Request(parameters=[odd]), 60.0)
        results = response.results if kind is SetParameters else [response.result]
        assert [result.successful for result in results] == [False]


def test_a_line_has_a_longest_length_and_no_control_characters():
    assert clean('plain text, ümläuts') == 'plain text, ümläuts'
    assert clean('a\nb\x1b[2Jc\x00') == r'a\nb\x1b[2Jc\x00'
    long = clean('x' * 10**6)
    assert len(long) < LONGEST + 60
    assert '999000 characters left out' in long


def test_warnings_have_a_rate_and_the_rest_is_counted(graph, capfd):
    log = graph.add(PatrolNode, name='chatty').get_logger()
    begun = time.monotonic()
    for number in range(500):
        log.warn(f'number {number}')
    log.info('the end')
    lines = capfd.readouterr().err.splitlines()
    most = WARNINGS_AT_ONCE + WARNINGS_PER_SECOND * (time.monotonic() - begun)
    assert 10 < sum('number' in line for line in lines) <= most + 1
    assert any('lines left out before this one' in line for line in lines)


def test_a_flood_of_lines_has_a_rate_and_hides_no_warning(graph, capfd):
    log = graph.add(PatrolNode, name='flooded').get_logger()
    begun = time.monotonic()
    for number in range(1000):
        log.info(f'number {number}')
    log.warn('the lidar is silent')
    log.fatal('the end')
    lines = capfd.readouterr().err.splitlines()
    most = LINES_AT_ONCE + LINES_PER_SECOND * (time.monotonic() - begun)
    assert 30 < sum('number' in line for line in lines) <= most + 1
    assert any('the lidar is silent' in line for line in lines)
    assert any('the end' in line for line in lines)


def test_no_node_has_the_service_that_logs_requests_as_they_came(graph):
    node = graph.add(PatrolNode, name='quiet')
    assert not node.get_parameter('start_type_description_service').value
    names = [name for name, _ in node.get_service_names_and_types_by_node('quiet', '/')]
    assert names
    assert not any('get_type_description' in name for name in names)


def test_no_minute_of_a_node_has_more_than_600_lines():
    rate = LINES_PER_SECOND + WARNINGS_PER_SECOND
    assert LINES_AT_ONCE + WARNINGS_AT_ONCE + 60.0 * rate <= 600.0


def test_an_allowance_grows_with_time():
    time = 0.0
    allowance = Allowance(2.0, 8.0, lambda: time)
    assert sum(allowance.take() for _ in range(100)) == 8
    time = 1.0
    assert sum(allowance.take() for _ in range(100)) == 2


def test_lines_of_several_threads_are_counted_together(graph, capfd):
    log = graph.add(PatrolNode, name='threads').get_logger()
    begun = time.monotonic()
    threads = [
        threading.Thread(target=lambda: [log.error('same') for _ in range(100)]) for _ in range(4)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    most = WARNINGS_AT_ONCE + WARNINGS_PER_SECOND * (time.monotonic() - begun)
    assert sum('same' in line for line in capfd.readouterr().err.splitlines()) <= most + 1
