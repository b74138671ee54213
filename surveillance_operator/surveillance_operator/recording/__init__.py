"""Recordings of missions: files that Foxglove and `ros2 bag` open, and the time line to replay."""
