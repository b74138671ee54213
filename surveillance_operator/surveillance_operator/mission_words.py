"""What a mission is about, in words: the same sentences for every view."""

from __future__ import annotations

from surveillance_operator.mission_state import ERROR, STALE, MissionState

WAITS_FOR_HELP = 'the robot waits for help'
STOPPED = 'the robot is stopped'


def doing(state: MissionState) -> str:
    """Return in a few words what the robot is about."""
    status, fleet_report = state.task.status, state.task.fleet_report
    if status is None:
        return 'begins' if state.health.nodes else 'not heard yet'
    if not state.health.nodes:
        return 'not heard any more'
    if state.task.stopped:
        return 'stopped'
    if status.waiting_for_help:
        return 'waits for help'
    if state.machine.paused:
        return 'paused'
    if state.task.is_out:
        return 'taken out of the patrol'
    if fleet_report is not None and fleet_report.dock and fleet_report.dock == state.robot_place:
        return f'charging at {fleet_report.dock}'
    if fleet_report is not None and fleet_report.heading_to:
        kind = 'on its way to' if fleet_report.is_moving else 'waits to go to'
        to_charge = f' to charge at {fleet_report.dock}' if fleet_report.dock else ''
        return f'{kind} {fleet_report.heading_to}{to_charge}'
    if status.heading_to not in ('', state.robot_place):
        return f'on its way to {status.heading_to}'
    return (status.state or 'begins').lower().replace('_', ' ')


def shares(state: MissionState) -> str:
    """Return which places of a fleet's patrol are the robot's; empty: it is in no fleet."""
    fleet_report = state.task.fleet_report
    if fleet_report is None:
        return ''
    if not fleet_report.tour:
        return 'no share'
    return f'shares {", ".join(fleet_report.tour)}, next {fleet_report.stop}'


def troubles(state: MissionState) -> list[str]:
    """Return what a person should look at, in words, the most important first."""
    found = []
    status = state.task.status
    if state.task.stopped:
        found.append('stopped until a person releases it')
    if status is not None and status.waiting_for_help:
        found.append(f'waits for help: {status.text}')
    if status is not None and not state.health.nodes:
        return [*found, 'none of its programs is heard']
    if state.health.ended:
        found.append(f'ended: {", ".join(sorted(state.health.ended))}')
    start = f'{state.namespace}/' if state.namespace else ''
    silent = []
    for name, each in sorted(state.health.reports.items()):
        own = name.removeprefix(start)
        is_own = name.startswith(start) and '/' not in own
        if not is_own or each.level < ERROR or own.partition(':')[0] in state.health.ended:
            continue
        if each.level == STALE:
            silent.append(own)
        else:
            found.append(f'{own}: {each.message}')
    if silent:
        found.append(f'silent: {", ".join(silent)}')
    return found


def decision_line(state: MissionState) -> str:
    """Return the decision without its reason."""
    decision, number = state.task.decision, state.task.decision_number
    assert decision is not None
    return f'decision {number}: {decision.from_place} → {decision.place} [{decision.rule}]'


def why(state: MissionState) -> tuple[str, str] | None:
    """Return what the robot is about and the reason: the decision, or what it waits for."""
    status, decision = state.task.status, state.task.decision
    if state.task.stopped:
        return STOPPED, 'until a person releases it'
    if status is not None and status.waiting_for_help:
        return WAITS_FOR_HELP, status.text
    return None if decision is None else (decision_line(state), decision.reason)
