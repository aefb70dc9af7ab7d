"""How policies are learned, what a run keeps, and files of learned policies."""
