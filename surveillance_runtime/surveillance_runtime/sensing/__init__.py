"""What comes from the sensors: streams, their ages, transforms, and what does not come."""
