"""The guard's desk: alarms as a workflow, what was recorded, hand-over, films, who may do what."""
