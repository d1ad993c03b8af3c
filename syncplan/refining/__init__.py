"""Refinement of one plan: the problem, its smooth copy for IPOPT, starts, exact measures."""
