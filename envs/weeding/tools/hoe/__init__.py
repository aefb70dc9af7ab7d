"""The hoe on the 3-PRRS platform."""
