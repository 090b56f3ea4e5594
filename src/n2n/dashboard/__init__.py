"""Dashboards of runs, from one definition."""
