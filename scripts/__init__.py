"""The `fieldgym` command and the scripts it is made of."""
