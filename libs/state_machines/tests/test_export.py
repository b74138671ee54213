"""Drawings of one machine with all kinds of containers, line by line."""
# ruff: noqa: E501 - some of them are long

from __future__ import annotations

import pytest

import state_machines as fsm
from state_machines.export import to_ascii, to_graphviz, to_mermaid

from .states import Answer, Waiter

LOOK = 'style=filled, fillcolor=lightgrey'


@pytest.fixture
def machine():
    inner = fsm.StateMachine(['arrived', 'preempted'])
    inner.add_state('WAIT', Waiter(), {'done': 'arrived'})
    both = fsm.Concurrence(['done', 'preempted'], 'done')
    both.add_state('LEFT', Answer('x'))
    both.add_state('RIGHT', inner)
    each = fsm.Iterator(
        ['all', 'preempted'], [], [], it=[1, 2], it_label='k', exhausted_outcome='all'
    )
    each.set_state('DO', Answer('done', 'again'), ['done'], final_outcome_map={'again': 'all'})
    root = fsm.StateMachine(['end', 'preempted'])
    root.set_name('ROOT')
    root.add_state('A', Answer('done', 'again'), {'done': 'BOTH', 'again': 'A'})
    root.add_state('BOTH', both, {'done': 'EACH'})
    root.add_state('EACH', each, {'all': 'end'})
    root.add_interrupt('CHARGE', Answer('full', 'lost'), 2, {'lost': 'end'})
    return root


def test_mermaid(machine):
    assert (
        to_mermaid(machine)
        == """\
stateDiagram-v2
    state "A" as ROOT_2f_A
    state "BOTH" as ROOT_2f_BOTH {
        state "LEFT" as ROOT_2f_BOTH_2f_LEFT
        state "RIGHT" as ROOT_2f_BOTH_2f_RIGHT {
            state "WAIT" as ROOT_2f_BOTH_2f_RIGHT_2f_WAIT
            [*] --> ROOT_2f_BOTH_2f_RIGHT_2f_WAIT
            ROOT_2f_BOTH_2f_RIGHT_2f_WAIT --> [*] : done → arrived
            ROOT_2f_BOTH_2f_RIGHT_2f_WAIT --> [*] : preempted
        }
        [*] --> ROOT_2f_BOTH_2f_LEFT
        ROOT_2f_BOTH_2f_LEFT --> [*] : x
        --
        [*] --> ROOT_2f_BOTH_2f_RIGHT
        ROOT_2f_BOTH_2f_RIGHT --> [*] : arrived
        ROOT_2f_BOTH_2f_RIGHT --> [*] : preempted
    }
    state "EACH" as ROOT_2f_EACH {
        state "DO" as ROOT_2f_EACH_2f_DO
        [*] --> ROOT_2f_EACH_2f_DO
        ROOT_2f_EACH_2f_DO --> ROOT_2f_EACH_2f_DO : done
        ROOT_2f_EACH_2f_DO --> [*] : again, all → all
    }
    state "CHARGE" as ROOT_2f_CHARGE
    [*] --> ROOT_2f_A
    ROOT_2f_A --> ROOT_2f_BOTH : done
    ROOT_2f_A --> ROOT_2f_A : again
    ROOT_2f_BOTH --> ROOT_2f_EACH : done
    ROOT_2f_BOTH --> [*] : preempted
    ROOT_2f_EACH --> [*] : all → end
    ROOT_2f_EACH --> [*] : preempted
    ROOT_2f_CHARGE --> ROOT_2f_CHARGE : full (resume)
    ROOT_2f_CHARGE --> [*] : lost → end
"""
    )


def test_graphviz(machine):
    assert (
        to_graphviz(machine).replace(LOOK, 'LOOK')
        == """\
digraph "ROOT" {
    compound=true; rankdir=TB; fontname="Helvetica";
    node [shape=box, style=rounded, fontname="Helvetica"];
    edge [fontname="Helvetica", fontsize=10];
    subgraph "cluster_ROOT" {
        label="ROOT (StateMachine)";
        "ROOT:end" [label="end", shape=oval, LOOK];
        "ROOT:preempted" [label="preempted", shape=oval, LOOK];
        "ROOT/A" [label="A", penwidth=2];
        subgraph "cluster_ROOT/BOTH" {
            label="BOTH (Concurrence)";
            "ROOT/BOTH:done" [label="done", shape=oval, LOOK];
            "ROOT/BOTH:preempted" [label="preempted", shape=oval, LOOK];
            "ROOT/BOTH/LEFT" [label="LEFT", penwidth=2];
            subgraph "cluster_ROOT/BOTH/RIGHT" {
                label="RIGHT (StateMachine)";
                "ROOT/BOTH/RIGHT:arrived" [label="arrived", shape=oval, LOOK];
                "ROOT/BOTH/RIGHT:preempted" [label="preempted", shape=oval, LOOK];
                "ROOT/BOTH/RIGHT/WAIT" [label="WAIT", penwidth=2];
            }
            "ROOT/BOTH/RIGHT/WAIT" -> "ROOT/BOTH/RIGHT:arrived" [label="done"];
            "ROOT/BOTH/RIGHT/WAIT" -> "ROOT/BOTH/RIGHT:preempted" [label="preempted"];
        }
        subgraph "cluster_ROOT/EACH" {
            label="EACH (Iterator)";
            "ROOT/EACH:all" [label="all", shape=oval, LOOK];
            "ROOT/EACH:preempted" [label="preempted", shape=oval, LOOK];
            "ROOT/EACH/DO" [label="DO", penwidth=2];
        }
        "ROOT/EACH/DO" -> "ROOT/EACH/DO" [label="done"];
        "ROOT/EACH/DO" -> "ROOT/EACH:all" [label="again"];
        "ROOT/EACH/DO" -> "ROOT/EACH:all" [label="all"];
        "ROOT/CHARGE" [label="CHARGE", style="rounded,dashed"];
    }
    "ROOT/A" -> "ROOT/BOTH/LEFT" [label="done", lhead="cluster_ROOT/BOTH"];
    "ROOT/A" -> "ROOT/A" [label="again"];
    "ROOT/BOTH/LEFT" -> "ROOT/EACH/DO" [label="done", ltail="cluster_ROOT/BOTH", lhead="cluster_ROOT/EACH"];
    "ROOT/BOTH/LEFT" -> "ROOT:preempted" [label="preempted", ltail="cluster_ROOT/BOTH"];
    "ROOT/EACH/DO" -> "ROOT:end" [label="all", ltail="cluster_ROOT/EACH"];
    "ROOT/EACH/DO" -> "ROOT:preempted" [label="preempted", ltail="cluster_ROOT/EACH"];
    "ROOT/CHARGE" -> "ROOT:end" [label="lost"];
}
"""
    )


def test_ascii(machine):
    assert (
        to_ascii(machine)
        == """\
ROOT (StateMachine) ends with end, preempted
|-* A  done -> BOTH; again -> A
|-  BOTH (Concurrence)  done -> EACH; preempted -> [preempted]
|    |-* LEFT
|    `-* RIGHT (StateMachine)
|         `-* WAIT  done -> [arrived]; preempted -> [preempted]
|-  EACH (Iterator)  all -> [end]; preempted -> [preempted]
|    `-* DO  done -> DO; again, all -> [all]
`-  CHARGE !  full -> RESUME; lost -> [end]
"""
    )


def test_a_container_without_states_is_drawn():
    outer = fsm.StateMachine(['done'])
    outer.add_state('A', Answer('done'), {'done': 'EMPTY'})
    outer.add_state('EMPTY', fsm.StateMachine(['done']))
    dot = to_graphviz(outer)
    to_empty = '-> "StateMachine/EMPTY" [label="done", lhead="cluster_StateMachine/EMPTY"];'
    assert f'"StateMachine/A" {to_empty}' in dot
