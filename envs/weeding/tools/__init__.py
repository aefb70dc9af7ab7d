"""What weeders carry: a folder a tool."""
