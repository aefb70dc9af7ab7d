"""The laser on the 3UPS-RPU platform."""
