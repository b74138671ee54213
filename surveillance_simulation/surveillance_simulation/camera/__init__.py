"""The simulated camera and what it renders."""
