"""From what object detectors write, and the camera, to views."""
