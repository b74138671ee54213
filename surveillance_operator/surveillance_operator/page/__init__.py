"""The live page of a mission: its server, and what it serves."""
