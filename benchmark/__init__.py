"""Suites, runner, statistics, tables and plots; the reproduction of the papers' published results."""
