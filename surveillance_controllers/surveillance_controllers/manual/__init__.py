"""MANUAL mode: requests that wait for an operator, and the commands that answer them."""
