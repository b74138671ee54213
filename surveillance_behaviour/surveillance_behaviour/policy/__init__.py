"""Which place next: rules, policies within the rules, and the battery's reserve. No ROS inside."""
