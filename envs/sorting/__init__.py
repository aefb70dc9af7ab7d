"""Sorting produce from a moving belt into bins with the 3-PRRS."""
