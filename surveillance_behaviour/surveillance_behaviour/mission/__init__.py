"""The memory of a mission: what happened, what failed, what the battery says."""
