"""Texts of messages from any peer."""

from __future__ import annotations

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from sensor_msgs.msg import JointState

from surveillance_interfaces.msg import MissionStatus
from surveillance_runtime.conversions import clean_texts


def test_texts_of_a_message_command_no_terminal() -> None:
    message = DiagnosticArray(
        status=[DiagnosticStatus(name='a\x1b[2Jb', values=[KeyValue(key='k', value='\x07')])]
    )
    message.header.frame_id = 'map\r'
    clean_texts(message)
    assert message.status[0].name == r'a\x1b[2Jb'
    assert message.status[0].values[0].value == r'\x07'
    assert message.header.frame_id == r'map\r'


def test_line_breaks_numbers_and_plain_texts_stay() -> None:
    message = MissionStatus(stamp=Time(sec=5), text='ümläut\nnext', avoided=['R1', '\x1b'])
    clean_texts(message)
    assert message == MissionStatus(stamp=Time(sec=5), text='ümläut\nnext', avoided=['R1', r'\x1b'])
    joints = JointState(name=['a'], position=[1.0])
    clean_texts(joints)
    assert joints == JointState(name=['a'], position=[1.0])
