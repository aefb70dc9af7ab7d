"""Picking safflower filaments with a planar five-bar on a cart that stops."""
