"""SMACH-style state machine engine, patrol policies and the behaviour of the surveillance robot."""
