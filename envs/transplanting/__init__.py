"""The tray transplanter."""
