"""Attacks on a running service: each once stopped it, starved somebody or leaked something."""
