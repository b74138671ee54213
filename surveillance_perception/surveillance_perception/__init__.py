"""ArUco detection, marker server and camera arm of the surveillance robot."""
