"""Designs from briefs."""
