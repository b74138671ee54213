"""The robot's eyes: the camera on its arm, and the markers that it reads.

- `aruco_detector_node`: the library `marker_detection` on a stream of images; begin there;
- `marker_server_node`, `marker_registry`: what place a marker stands for;
- `arm_controller_node`, `arm`: kinematics, trajectories and scans of the arm;
- `observer_node`, `observing`: `indoor_watch` on scans and pictures, paired with poses;
- `stream`: images from files, videos and webcams; `video_source_node` publishes them.
"""
