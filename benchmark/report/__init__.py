"""The benchmark as one HTML page and as a Markdown leaderboard."""
