"""What the documentation's site is made of beside its pages: nothing that the code declares is typed twice.

``make docs`` writes pages of the environments, their pictures and replays, the leaderboard at a glance and the papers'
reproduction from the package itself before Sphinx reads the sources (``docs/conf.py``).
"""
