"""The system's Chromium, for pages that are measured and tested where nobody looks."""

from __future__ import annotations

from shutil import which

PATH = next(filter(None, map(which, ("chromium", "chromium-browser", "google-chrome"))), None)
"""Where it is; None on a machine without one."""
ARGUMENTS = ("--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist")
"""Draw in software, as anybody."""
