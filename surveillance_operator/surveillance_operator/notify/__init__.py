"""Telling people of incidents: what is told (`news`), how (`settings`), to whom (`sinks`), and that
nothing is lost on the way (`outbox`).
"""
