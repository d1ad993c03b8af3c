"""Exports: one module a format, and what they share: names, places on Earth, poses, missions."""
