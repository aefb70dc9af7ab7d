"""Images to targets: OpenCV and NumPy only."""
