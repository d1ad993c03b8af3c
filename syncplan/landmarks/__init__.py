"""Which of several candidate sites landmarks should be set at.

site_information   what each site would add
site_search        the convex relaxation and its bound, rounding, swaps, proof
site_choice        candidates as the user gives them, and the choice, judged
"""
