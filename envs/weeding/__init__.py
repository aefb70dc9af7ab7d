"""Weeding from a cart that never stops: a laser that follows each weed while it burns."""
