"""Placement of centres: what a drawing must meet, convex steps towards it, why none exists."""
