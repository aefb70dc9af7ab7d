"""What is assumed: parameters with the range that sources leave them, one list a task."""
