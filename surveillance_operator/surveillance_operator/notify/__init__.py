"""Telling people of incidents: the book and the log (`incident_keeper`), how a person is called
(`calls`), what is told (`notification`), to whom (`sinks`), and that nothing is lost on
the way (`outbox`). The node `alarm` holds all of it.
"""
